"""Cost of the network in a tick, and stops of two stations at random moments.

    python benchmarks/stations.py            both
    python benchmarks/stations.py --cost     the cost only
    python benchmarks/stations.py --stops N  N trials per cause

Cost: two stations on the loopback interface exchange a datagram in each tick. Beside it, in the
same run, two plain sockets exchange bytes of the same size.

Stops: two stations in virtual time, over a network with a delay of 10 ms, a jitter of 5 ms and a
loss of 2 %. At a random moment of the trial, one station is killed or suspended for 0.3 to 1 s, or
the network is cut in one or both directions. The table states the longest time until both commands
are zero, and the largest travel of the slave after the last datagram, divided by its speed. After
that, the cause is removed, and nothing may move again.
"""

from __future__ import annotations

import argparse
import math
import random
import socket
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "teleop" / "station"))

from network import Faults, StationOfTest, TwoStations, session  # noqa: E402

from teleop.control.feedback.settings import FeedbackSettings  # noqa: E402
from teleop.safety import Mode  # noqa: E402
from teleop.safety.state import Supervision, Verdict  # noqa: E402
from teleop.settings.trial_settings import TrialSettings  # noqa: E402
from teleop.station.address import Address  # noqa: E402
from teleop.station.datagram import SIZE  # noqa: E402
from teleop.station.peer import Peer  # noqa: E402
from teleop.station.station import Station  # noqa: E402
from teleop.station.station_port import StationPort  # noqa: E402

TICKS = 20_000
NETWORK = Faults(delay=10e-3, jitter=5e-3, loss=0.02)
CAUSES = (
    "master killed",
    "slave killed",
    "master suspended",
    "slave suspended",
    "cut to the slave",
    "cut to the master",
    "cut both ways",
)
LOOPBACK = Address(socket.AF_INET, ("127.0.0.1", 0))


def percentiles(seconds: list[float]) -> str:
    low, high = np.percentile(np.array(seconds) * 1e6, [50, 99])
    return f"{low:6.1f} us p50   {high:6.1f} us p99"


def cost() -> None:
    """Print the time that a station needs for the network in a tick."""
    with StationPort(LOOPBACK, True) as here, StationPort(LOOPBACK, True) as there:
        now = time.perf_counter
        stations = [
            Station(side, Peer(port, other.place, session(side), now))
            for side, port, other in (("master", here, there), ("slave", there, here))
        ]
        master, slave = stations
        verdict = Verdict(Supervision(Mode.READY), (0.0, 0.0))
        plain = [socket.socket(type=socket.SOCK_DGRAM) for _ in range(2)]
        for one in plain:
            one.bind(("127.0.0.1", 0))
            one.setblocking(False)
        own, bare, data = [], [], bytes(SIZE)
        for _ in range(TICKS):
            slave.send(verdict, (0.0,) * 7)
            slave.read(True, False)
            start = now()
            master.read(True, False)
            master.send(verdict, (0.0,) * 3)
            master.values(start)
            own.append(now() - start)
            plain[1].sendto(data, plain[0].getsockname())
            start = now()
            plain[0].recv(2048)
            plain[0].sendto(data, plain[1].getsockname())
            bare.append(now() - start)
            plain[1].recv(2048)
        assert master.peer.window.received == TICKS
    print(f"one station, read and send         {percentiles(own)}")
    print(f"plain sockets, receive and send    {percentiles(bare)}")


def stop(cause: str, seed: int) -> tuple[float, float, float]:
    """Return the time to zero commands, the travel in ms of speed, and the width of the offset."""
    draw = random.Random(f"{cause} {seed}")
    law = draw.choice(["none", "model-mediated"])
    settings = TrialSettings(
        clock="virtual",
        duration=6.0,
        estimators=("rls",),
        seed=seed,
        feedback=FeedbackSettings(law),
    )
    pair = TwoStations(
        settings, replace(NETWORK), replace(NETWORK), seed, error=draw.uniform(-1, 1) * 9e-5
    )
    while pair.master.controller.mode is not Mode.ACTIVE:
        pair.step()
    pair.run(draw.randrange(300, 2500))
    slave = pair.slave
    before = len(slave.recording)
    killed: StationOfTest | None = None
    whom = pair.master if cause.startswith("master") else pair.slave
    suspended = 0
    if "killed" in cause or "suspended" in cause:
        killed = whom
        suspended = draw.randrange(300, 1000) if "suspended" in cause else 10**6
    pair.forth.cut = cause in ("cut to the slave", "cut both ways")
    pair.back.cut = cause in ("cut to the master", "cut both ways")
    zero = 0
    for tick in range(1400):
        for one in (pair.master, pair.slave):
            if one is killed and tick < suspended:
                one.clock.wait()
            else:
                one.step()
        moving = any(
            any(one.controller._supervision.applied)
            for one in (pair.master, pair.slave)
            if not (one is killed and tick < suspended)
        )
        if moving:
            assert tick < 1000 or zero == tick - 1, (cause, seed)
            zero = tick
    pair.forth.cut = pair.back.cut = False
    pair.run(500)
    recording = slave.recording
    assert not np.any(recording["commanded_slave_velocity"][-400:]), (cause, seed)
    assert not np.any(pair.master.recording["commanded_master_velocity"][-400:]), (cause, seed)
    offset = [
        (one.recording["offset_low"], one.recording["offset_high"], one.recording["station_clock"])
        for one in (pair.slave,)
    ]
    for low, high, clock in offset:
        true = clock - (clock - pair.offset) / (1.0 + slave.clock.error)
        known = np.isfinite(low)
        assert np.all(low[known] - 1e-6 <= true[known]), (cause, seed)
        assert np.all(true[known] <= high[known] + 1e-6), (cause, seed)
    travel = math.nan
    if cause in ("master killed", "master suspended", "cut to the slave", "cut both ways"):
        # what was on its way still arrives, and is played out
        last = before + round((NETWORK.delay + 2.0 * NETWORK.jitter) * 1e3)
        speed = np.max(np.abs(recording["commanded_slave_velocity"][before - 5 : last + 1]))
        moved = np.abs(recording["slave_position"][last:] - recording["slave_position"][last])
        travel = float(np.max(moved[:400]) / speed) if speed > 5e-3 else math.nan
    return zero * 1e-3, travel, float(np.nanmax(high - low))


def stops(count: int) -> None:
    """Print a table of the stops."""
    print(f"{'cause':20} trials   zero commands after   travel / speed   offset in its interval")
    for cause in CAUSES:
        found = [stop(cause, seed) for seed in range(count)]
        longest = max(one[0] for one in found)
        travels = [one[1] for one in found if math.isfinite(one[1])]
        travel = f"{max(travels) * 1e3:8.1f} ms" if travels else "           "
        print(f"{cause:20} {count:6} {longest * 1e3:13.0f} ms {travel:>18} {count:12} of {count}")
        sys.stdout.flush()


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cost", action="store_true")
    parser.add_argument("--stops", type=int, default=0)
    options = parser.parse_args()
    if options.cost or not options.stops:
        cost()
    if options.stops or not options.cost:
        stops(options.stops or 29)
    return 0


if __name__ == "__main__":
    sys.exit(main())
