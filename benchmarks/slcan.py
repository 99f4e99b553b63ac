"""Our slcan bus beside python-can's own, in one run: two frames out and two in per cycle.

    python benchmarks/slcan.py                 # 5000 cycles of each, in turn

The emulated adapter answers over a pseudo-terminal from another process, as fast as it can. What
is timed is the loop's part of a cycle: take the two frames that have come back, and send two; their
way there and back is not in it. Cycles back to back find the processor's caches warm; cycles 1 ms
apart find them as a loop at 1 kHz does.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import can
import numpy as np
from can.interfaces.slcan import slcanBus

from drivers.transports.slcan import SlcanBus
from sim_backend.wire.slcan_adapter import SlcanAdapter

FRAMES = [
    can.Message(arbitration_id=0x201, is_extended_id=False, data=bytes(range(8))),
    can.Message(arbitration_id=0x301, is_extended_id=False, data=bytes(range(8))),
]
ANSWER = 2 * len(b"z\rt20180001020304050607\r")
"""Bytes that come back per cycle."""
PERIODS = {"back to back": 0.0, "1 ms apart": 1e-3}
ROUNDS = 5


def serve() -> None:
    """Be the adapter: name the port, then send every frame back."""
    import tty

    leader, follower = os.openpty()
    tty.setraw(follower)
    print(os.ttyname(follower), flush=True)
    adapter = SlcanAdapter()
    while data := os.read(leader, 4096):
        back = adapter.receive(data)
        os.write(leader, adapter.pending() + b"".join(map(adapter.encode, back)))


@contextmanager
def adapter() -> Iterator[str]:
    """An adapter in another process; its port."""
    command = [sys.executable, __file__, "--adapter"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def take_ours(bus: SlcanBus) -> int:
    return len(bus.drain())


def take_theirs(bus: slcanBus) -> int:
    count = 0
    while count < len(FRAMES) and bus.recv(0.1):
        count += 1
    return count


def measure(
    bus: Any, port: Any, take: Callable[[Any], int], period: float, count: int
) -> list[float]:
    """Times of the loop's part of each cycle [us], with a pause of a period [s] between them."""
    times = []
    for frame in FRAMES:
        bus.send(frame)
    for _ in range(count):
        if period:
            time.sleep(period)
        while port.in_waiting < ANSWER:
            pass
        start = time.perf_counter()
        taken = take(bus)
        for frame in FRAMES:
            bus.send(frame)
        times.append(1e6 * (time.perf_counter() - start))
        if taken != len(FRAMES):
            raise SystemExit(f"{type(bus).__name__} received {taken} of {len(FRAMES)} frames")
    while port.in_waiting < ANSWER:
        pass
    take(bus)
    return times


def look(take: Callable[[], object], count: int) -> list[float]:
    """Times of a look at a port that holds nothing [us]."""
    times = []
    for _ in range(count):
        start = time.perf_counter()
        take()
        times.append(1e6 * (time.perf_counter() - start))
    return times


def row(title: str, times: list[float]) -> tuple[float, float]:
    p50, p99 = np.percentile(times, [50.0, 99.0])
    print(f"  {title:28s} p50 {p50:8.1f}  p99 {p99:8.1f} us")
    return float(p50), float(p99)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cycles", type=int, default=5000, help="of each bus")
    parser.add_argument("--adapter", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.adapter:
        serve()
    count = options.cycles // ROUNDS
    ours: dict[str, list[float]] = {way: [] for way in PERIODS}
    theirs: dict[str, list[float]] = {way: [] for way in PERIODS}
    ours_empty, theirs_empty = [], []
    for _ in range(ROUNDS):
        for way, period in PERIODS.items():
            with adapter() as name, SlcanBus(name, 500_000) as bus:
                ours[way] += measure(bus, bus._port._port, take_ours, period, count)
                ours_empty += look(bus.drain, count)
            with adapter() as name, slcanBus(name, bitrate=500_000, sleep_after_open=0.0) as peer:
                time.sleep(0.1)
                peer.flush()
                theirs[way] += measure(peer, peer.serialPortOrig, take_theirs, period, count)
                theirs_empty += look(lambda: peer.recv(0.0), count // 10)
    for way in PERIODS:
        print(f"two frames out and two in, {len(ours[way])} cycles of each, {way}")
        our_p50, our_p99 = row("ours", ours[way])
        their_p50, their_p99 = row("python-can's slcan", theirs[way])
        print(f"  ratio of the p50 {their_p50 / our_p50:.1f}, of the p99 {their_p99 / our_p99:.1f}")
    print("nothing to take")
    row("ours, drain()", ours_empty)
    row("python-can's slcan, recv(0)", theirs_empty)


if __name__ == "__main__":
    main()
