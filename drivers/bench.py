"""Test bench of a driver: a device, its emulated device, and the port between them.

The time is virtual. `drivers.testing` uses the bench.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import can

from drivers.device import (
    CanDevice,
    DatagramDevice,
    Device,
    Drive,
    ForceDrive,
    ImpedanceDrive,
    PositionDrive,
    Sample,
    SerialDevice,
    SharedSerialDevice,
    VelocityDrive,
)
from drivers.rig import RigError
from drivers.transports.bus import Bus
from drivers.transports.can_adapter import EXTENDED
from drivers.transports.can_bus import CanBus
from drivers.transports.can_frame import CanFrame
from drivers.transports.datagram_port import DatagramPort
from drivers.transports.shared_line import SharedLine
from drivers.transports.stream_port import StreamPort

TICK = 1e-3
"""Period of the control loop on the bench [s]."""
BEGIN = 1000.0
"""Time of the controller's clock when a bench is made [s]. Other clocks are far from it."""
AHEAD = TICK
"""Largest time by which a sample may be newer than the present time [s].

A time that is computed from the time stamp of a device has an error of this size.
"""
BAUD = 115_200
"""Rate of the serial line [bit/s]."""
SPEED, STEP, FORCE = 0.01, 1e-3, 1.0
"""Velocity [m/s], change of position [m] and force [N] that are commanded."""
STIFFNESS, DAMPING = 100.0, 1.0
"""Gains that are commanded to a drive that closes a coupling itself [N/m] and [N s/m]."""

Frame = bytes | can.Message
Emit = Callable[[float], Sequence[Any]]
"""Function of the time [s] that returns the frames which a device sends."""


class Violation(BaseException):
    """A driver violates a rule. It is no `Exception`, so that a driver does not catch it."""

    def __init__(self, rule: str, seen: str) -> None:
        super().__init__(rule, seen)
        self.rule = rule
        self.seen = seen


class Emulated(Protocol):
    """What the bench uses of an emulated device."""

    def receive(self, data: Any, now: float) -> None:
        """Process a frame of the host at the time `now` [s]."""

    def emit(self, now: float) -> Sequence[Any]:
        """Return the frames that the device sends at the time `now` [s]."""


class Sender:
    """A device that only sends, by a function."""

    def __init__(self, emit: Emit) -> None:
        self.emit = emit

    def receive(self, data: Any, now: float) -> None:
        """Do nothing."""


class Sent(NamedTuple):
    """A frame that the driver has sent."""

    method: str
    """Method of the driver that sent the frame."""
    data: Frame
    time: float


class Bench:
    """A device that is connected to its emulated device.

    The bench is also the mount of the emulated device, and the part that its drive moves.
    `make_emulated`: makes the emulated device, as after power-up. `values`: value of each signal
    that the emulated device measures. `drive_name`: drive that is tested.
    """

    rate = 1000.0
    """Sample rate of emulated devices [Hz]."""

    def __init__(
        self,
        device: Device,
        make_emulated: Callable[[Bench], Emulated],
        values: Mapping[str, float],
        drive_name: str = "",
    ) -> None:
        self.device = device
        self.time = BEGIN
        self.values = dict(values)
        self.sensed: set[str] = set()
        """Signals that the emulated device has measured."""
        self.position = self.velocity = self.force = 0.0
        self.driven = False
        self.is_deaf = False
        """Whether no frame of the device arrives."""
        self.is_lost: Callable[[Sent], bool] = lambda sent: False
        """Whether a frame to the device is lost."""
        self.is_gone = False
        """Whether the port was removed."""
        streams = isinstance(device, SerialDevice | SharedSerialDevice)
        self.pieces: Callable[[Sequence[Any]], list[Any]] = joined if streams else list
        """Converts the frames of a tick to the data of the calls of `receive`."""
        self.reported = ""
        """Error of the device when the rig last read it."""
        self.sent: list[Sent] = []
        self.emitted: list[Any] = []
        """Frames that the device has sent."""
        self._arrived: list[Any] = []
        self._calling = ""
        self._make_emulated = make_emulated
        self._drive_name = drive_name
        self._origin = 0.0
        self.emulated = make_emulated(self)
        self._port = self._new_port()
        self._port.connect(self.device)

    # The mount of the emulated device.

    def sense(self, signal: str) -> float:
        """Return the value of a signal."""
        self.sensed.add(signal)
        own = {"position": self.position, "velocity": self.velocity, "force": self.force}
        return self.values.get(signal, own.get(signal, 0.0))

    def drive(self, name: str, velocity: float) -> None:
        """Move with a velocity [m/s]."""
        if name == self._drive_name:
            self.velocity, self.driven = velocity, True

    def push(self, name: str, force: float) -> None:
        """Exert a force [N] on the part, which a hand holds."""
        if name == self._drive_name:
            self.force, self.driven = force, True

    def brake(self, name: str) -> None:
        """Stop."""
        if name == self._drive_name:
            self.velocity = self.force = 0.0
            self.driven = False

    # The port.

    def now(self) -> float:
        """Return the time of the controller's clock [s]."""
        return self.time

    def put(self, data: Frame) -> None:
        """Pass a frame of the driver to the emulated device."""
        if self.is_gone:
            raise OSError("the test port was removed")
        sent = Sent(self._calling, data, self.time)
        self.sent.append(sent)
        if not self.is_lost(sent):
            with self._emulating("receive"):
                self.emulated.receive(data, self.time)

    def take(self) -> list[Any]:
        """Return the data that have arrived, one item per call of `receive`."""
        frames, self._arrived = self._arrived, []
        return self.pieces(frames)

    def nap(self, seconds: float) -> None:
        """Advance the time while the driver waits, which only `start` may do."""
        if self._calling != "start":
            raise Violation("waits", f"{self._calling} waits for {seconds * 1e3:g} ms")
        self.advance(seconds)

    def _new_port(self) -> Bus:
        port: Bus
        if isinstance(self.device, CanDevice):
            port = BenchCanBus(self)
        elif isinstance(self.device, DatagramDevice):
            port = BenchDatagramPort(self)
        elif isinstance(self.device, SerialDevice):
            port = BenchStreamPort(self)
        elif isinstance(self.device, SharedSerialDevice):
            port = SharedLine(BenchStreamPort(self))
        else:
            raise TypeError(
                f"{type(self.device).__name__}: expected a SerialDevice, SharedSerialDevice, "
                "CanDevice or DatagramDevice"
            )
        port.nap, port.pump = self.nap, self.poll
        return port

    # The host.

    @contextlib.contextmanager
    def during(self, method: str) -> Iterator[None]:
        """Call a method of the driver within this block. An exception violates a rule."""
        before, self._calling = self._calling, method
        try:
            yield
        except RigError as error:
            rule = "starts" if method == "start" else "raises"
            raise Violation(rule, f"{method} raised RigError: {one_line(error)}") from error
        except Exception as error:
            seen = f"{method} raised {type(error).__name__}: {one_line(error)}"
            raise Violation("raises", seen) from error
        finally:
            self._calling = before

    @contextlib.contextmanager
    def _emulating(self, method: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            seen = f"{method} of the emulated device raised {type(error).__name__}: "
            raise Violation("emulated", seen + one_line(error)) from error

    def start(self) -> None:
        """Open the port, and start the driver."""
        self._port = self._new_port()
        self._port.connect(self.device)
        self._arrived.clear()
        with self.during("start"):
            self._port.start(self.device)

    def restart_emulated(self) -> None:
        """Reset the emulated device, as by an interruption of its power supply."""
        self.brake(self._drive_name)
        self.emulated = self._make_emulated(self)

    def advance(self, seconds: float = TICK) -> None:
        """Advance the time. The device sends its frames."""
        self.time += seconds
        self.position += self.velocity * seconds
        with self._emulating("emit"):
            frames = self.emulated.emit(self.time)
        if not self.is_deaf:
            self.emitted += frames
            self._arrived += frames

    def poll(self) -> None:
        """Pass the data that have arrived to the driver, and check the times of its samples."""
        before = dict(self.device.samples)
        with self.during("receive"):
            self._port.poll()
        with self.during("update"):
            self.device.update(self.time)
        for signal, sample in self.device.samples.items():
            self._check_time(signal, sample, before.get(signal))
        self.reported = self.device.error

    def _check_time(self, signal: str, sample: Sample, before: Sample | None) -> None:
        ahead = sample.time - self.time
        if not ahead <= AHEAD:
            raise Violation("future", f"a sample of {signal} is {ahead * 1e3:.3g} ms ahead of now")
        if before and before.time > sample.time > -math.inf:
            back = (before.time - sample.time) * 1e3
            raise Violation("backwards", f"a sample of {signal} is {back:.3g} ms older than before")

    def read(self, seconds: float, *frames: Frame) -> None:
        """Read and transmit for some time. Further frames arrive in the first tick."""
        self._arrived += frames
        for _ in range(round(seconds / TICK)):
            self.advance()
            self.poll()
            with self.during("transmit"):
                self.device.transmit()

    def newest(self) -> float:
        """Return the time of the newest sample of the signal whose newest sample is oldest [s]."""
        return min(self.device.samples[signal].time for signal in self.device.signals())

    # The drive.

    @property
    def tested(self) -> Drive:
        """The drive that is tested."""
        return self.device.drives[self._drive_name]

    @property
    def is_stopped(self) -> bool:
        """Whether the drive causes neither motion nor force."""
        if isinstance(self.tested, PositionDrive):
            return not self.driven
        return self.velocity == 0.0 and self.force == 0.0

    def give(self, size: float) -> Any:
        """Command a motion or a force, in multiples of the usual one; return what was returned."""
        drive = self.tested
        with self.during("command"):
            if isinstance(drive, VelocityDrive):
                return drive.command(size * SPEED)
            if isinstance(drive, ForceDrive):
                return drive.command(size * FORCE)
            if isinstance(drive, PositionDrive):
                return drive.command(self._origin + size * STEP)
            assert isinstance(drive, ImpedanceDrive)
            gains = (STIFFNESS, DAMPING) if size else (0.0, 0.0)
            return drive.command(self._origin + size * STEP, 0.0, *gains)

    def applied(self, returned: Any) -> tuple[float, float]:
        """Return what the drive does, and what it should do by the value that was returned."""
        drive = self.tested
        if isinstance(drive, VelocityDrive):
            return self.velocity, returned
        if isinstance(drive, ForceDrive):
            return self.force, returned
        if isinstance(drive, PositionDrive):
            return self.position, returned
        assert isinstance(drive, ImpedanceDrive)
        position, velocity = returned
        stiffness, damping = drive.rounded(STIFFNESS, DAMPING)
        spring = stiffness * (position - self.position) + damping * (velocity - self.velocity)
        return self.force, spring

    def enable(self) -> bool:
        """Request operation in one tick, as the rig does; return whether it is confirmed."""
        self.advance()
        self.poll()
        signal = getattr(self.tested, "signal", "")
        if signal:
            self._origin = self.device.samples[signal].value
        self.give(0.0)
        with self.during("enable"):
            ready = self.tested.enable()
        with self.during("transmit"):
            self.device.transmit()
        return ready

    def command(self, size: float, seconds: float) -> Any:
        """Command a motion or a force in each tick; return what the last call returned."""
        returned: Any = math.nan
        for _ in range(round(seconds / TICK)):
            self.advance()
            self.poll()
            returned = self.give(size)
            with self.during("transmit"):
                self.device.transmit()
        return returned

    def idle(self) -> bool:
        """Request that the drive leaves operation; return whether it has confirmed this."""
        with self.during("idle"):
            return self.tested.idle()

    def ping(self) -> None:
        """Request an answer."""
        with self.during("ping"):
            self.device.ping()


def one_line(error: Exception) -> str:
    """Return the message of an exception in one line."""
    return " ".join(str(error).split())


def joined(frames: Sequence[bytes]) -> list[bytes]:
    """Return all bytes of a tick as the data of one call of `receive`."""
    data = b"".join(frames)
    return [data] if data else []


class BenchStreamPort(StreamPort):
    """A serial port or TCP connection on a bench."""

    def __init__(self, bench: Bench) -> None:
        super().__init__("bench", bench.now, "test port", BAUD)
        self._bench = bench

    def open(self) -> None:
        """Do nothing."""

    def poll(self) -> None:
        """Pass the pieces to the driver."""
        middle, self._polled = 0.5 * (self._polled + self.now()), self.now()
        for data in self._bench.take():
            self.received += len(data)
            if self._receive:
                self._receive(bytes(data), middle)

    def _read(self) -> bytes:
        return b"".join(self._bench.take())

    def _write(self, data: bytes) -> int:
        self._bench.put(data)
        return len(data)

    def close(self) -> None:
        """Do nothing."""


class BenchDatagramPort(DatagramPort):
    """A UDP port on a bench."""

    def __init__(self, bench: Bench) -> None:
        super().__init__("bench", bench.now, "192.0.2.1", 1)
        self._bench = bench

    def open(self) -> None:
        """Do nothing."""

    def poll(self) -> None:
        """Pass each datagram to the driver."""
        for data in self._bench.take():
            self.received += 1
            if self._receive:
                self._receive(bytes(data), self.now())

    def send(self, data: bytes) -> None:
        """Send a datagram."""
        try:
            self._bench.put(data)
        except OSError as error:
            raise self._gone(error) from error


class BenchCanBus(CanBus):
    """A CAN bus on a bench."""

    def __init__(self, bench: Bench) -> None:
        super().__init__("bench", bench.now, "bench", "test bus", None, {}, fd=True)
        self._bench = bench

    def open(self) -> None:
        """Do nothing."""

    def poll(self) -> None:
        """Pass each frame of the device to the driver."""
        for frame in self._bench.take():
            self.received += 1
            receive = self._routes.get(frame.arbitration_id | frame.is_extended_id * EXTENDED)
            if receive:
                receive(CanFrame.of(frame), self.now())

    def _put(self, frame: CanFrame) -> None:
        try:
            self._bench.put(frame.message())
        except OSError as error:
            raise self._gone(error) from error
