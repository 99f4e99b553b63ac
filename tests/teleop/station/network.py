"""Two stations in virtual time, and a network that delays, loses and repeats datagrams."""

from __future__ import annotations

import heapq
import itertools
import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from teleop.control.clock import VirtualClock
from teleop.control.station_settings import StationSettings
from teleop.recording.recording import Recording, from_columns
from teleop.settings.trial_settings import TrialSettings
from teleop.station.connection import Connection
from teleop.station.keys import Session, make_session
from teleop.station.station import Station
from teleop.station.station_port import Received
from teleop.streams.stream import Stream
from teleop.trial.assembly import make_controller, make_layout, make_rig
from teleop.trial.loop import Loop
from teleop.trial.metadata import session_metadata
from teleop.trial.readers import Readers
from teleop.trial.stop_switch import StopSwitch

KEY = bytes(range(32))
NONCES = bytes(range(32, 64))


def session(side: str, nonces: bytes = NONCES) -> Session:
    return make_session(KEY, nonces, side)


@dataclass
class Faults:
    """What a direction of the network does to each datagram."""

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    doubled: float = 0.0
    flood: int = 0
    """Forged datagrams per genuine one."""
    cut: bool = False
    changed: Callable[[bytes], bytes] | None = None
    """Replaces each datagram."""


@dataclass
class VirtualPort:
    """One end of a network in virtual time, in place of a `StationPort`."""

    now: Callable[[], float]
    faults: Faults
    random: random.Random
    queue: list[tuple[float, int, bytes]] = field(default_factory=list)
    other: VirtualPort | None = None
    unsent: int = 0
    sent: list[bytes] = field(default_factory=list)
    numbers: itertools.count = field(default_factory=itertools.count)

    def send(self, data: bytes, place: object) -> None:
        self.sent.append(data)
        faults, draw = self.faults, self.random.random
        if faults.cut:
            return
        for _ in range(faults.flood):
            forged = bytearray(data)
            forged[self.random.randrange(len(forged))] ^= 1 << self.random.randrange(8)
            self._deliver(bytes(forged))
        if draw() >= faults.loss:
            self._deliver(faults.changed(data) if faults.changed else data)
        if draw() < faults.doubled:
            self._deliver(data)

    def _deliver(self, data: bytes) -> None:
        arrival = self.now() + self.faults.delay + self.faults.jitter * self.random.random()
        self.inject(data, arrival)

    def inject(self, data: bytes, arrival: float) -> None:
        assert self.other
        heapq.heappush(self.other.queue, (arrival, next(self.numbers), data))

    def receive(self, most: int) -> list[Received]:
        found, now = [], self.now()
        while self.queue and self.queue[0][0] <= now + 1e-12 and len(found) < most:
            arrival, _, data = heapq.heappop(self.queue)
            found.append(Received(data, (), now - arrival))
        return found


class ShiftedClock(VirtualClock):
    """Virtual clock of a station, which differs from the true time by an offset and a rate."""

    def __init__(self, rate: float, offset: float = 0.0, error: float = 0.0) -> None:
        super().__init__(rate)
        self.offset, self.error = offset, error

    def true(self) -> float:
        return self._now

    def now(self) -> float:
        return self._now * (1.0 + self.error) + self.offset

    stopwatch = now


class StationOfTest:
    """One of the two stations: its loop, rig and switch."""

    def __init__(self, settings, port, side, clock, longest):
        self.settings = replace(settings, station=settings.station or StationSettings(side))
        self.clock, self.port, self.side = clock, port, side
        connection = Connection(port, (), session(side), side, longest, {"rig": "other"})
        self.station: Station = connection.begin(clock)
        self.switch = StopSwitch()
        self.switch.station = self.station
        self.rig = make_rig(self.settings, clock.now)
        self.rig.open()
        bank = self.settings.estimation_preset.bank()
        self.controller = make_controller(self.settings, self.rig, clock, station=self.station)
        self.stream = Stream(make_layout(self.settings, bank), 20_000)
        duration = self.settings.duration
        self.loop = Loop(self.controller, clock, self.stream, Readers(), self.switch, duration)
        self.runs = True

    def step(self) -> None:
        if not self.runs:
            self.clock.wait()
        elif not self.loop.step():
            self.runs = False
            self.station.finish()

    @property
    def recording(self) -> Recording:
        stream = self.stream
        columns = stream.reader().columns(1, stream.newest + 1)
        metadata = session_metadata(self.settings)
        return from_columns(stream.schema, columns, stream.events, metadata)

    @property
    def faults(self) -> list[str]:
        return [event["fault"] for event in self.stream.events if event["fault"]]


class TwoStations:
    """Both stations, whose ticks alternate: the slave is half a period later."""

    def __init__(
        self,
        settings: TrialSettings,
        forth: Faults | None = None,
        back: Faults | None = None,
        seed: int = 0,
        offset: float = 12.5,
        error: float = 40e-6,
        longest: float = float("inf"),
        slave: TrialSettings | None = None,
    ) -> None:
        self.forth, self.back = forth or Faults(), back or forth or Faults()
        rate = settings.loop_rate
        clocks = ShiftedClock(rate), ShiftedClock(rate, offset, error)
        draws = random.Random(f"forth {seed}"), random.Random(f"back {seed}")
        half = 0.5 / rate
        ports = (
            VirtualPort(clocks[0].true, self.forth, draws[0]),
            VirtualPort(lambda: clocks[1].true() + half, self.back, draws[1]),
        )
        ports[0].other, ports[1].other = ports[1], ports[0]
        self.master = StationOfTest(settings, ports[0], "master", clocks[0], longest)
        longer = slave or replace(settings, duration=settings.duration + 10.0)
        self.slave = StationOfTest(longer, ports[1], "slave", clocks[1], longest)
        self.offset = offset

    def step(self) -> None:
        self.master.step()
        self.slave.step()

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            self.step()
            if not (self.master.runs or self.slave.runs):
                return
