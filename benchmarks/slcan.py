"""Measure the time to send and receive two frames with our slcan bus and with python-can's.

    python benchmarks/slcan.py                 # 5000 cycles of each, alternating

The emulated adapter runs in another process, is connected by a pseudo-terminal, and responds as
fast as possible. In each cycle, the loop receives the two frames that have arrived, and sends two
frames. The time of these two steps is measured, without the transfer to the adapter and back. In
cycles without a pause, the processor's caches keep their data. In cycles with a pause of 1 ms, the
caches are as in a loop at 1 kHz.
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
RECEIVED = 2 * len(b"z\rt20180001020304050607\r")
"""Number of bytes that arrive per cycle."""
PERIODS = {"back to back": 0.0, "1 ms apart": 1e-3}
ROUNDS = 5


def serve() -> None:
    """Act as the adapter: print the name of its port, then send every frame back."""
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
    """Start an adapter in another process; yield its port."""
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
    """Return the times of the loop's part of each cycle [us], with a pause [s] between cycles."""
    times = []
    for frame in FRAMES:
        bus.send(frame)
    for _ in range(count):
        if period:
            time.sleep(period)
        while port.in_waiting < RECEIVED:
            pass
        start = time.perf_counter()
        taken = take(bus)
        for frame in FRAMES:
            bus.send(frame)
        times.append(1e6 * (time.perf_counter() - start))
        if taken != len(FRAMES):
            raise SystemExit(f"{type(bus).__name__} received {taken} of {len(FRAMES)} frames")
    while port.in_waiting < RECEIVED:
        pass
    take(bus)
    return times


def poll_empty(take: Callable[[], object], count: int) -> list[float]:
    """Return the times to poll a port without data [us]."""
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
                ours_empty += poll_empty(bus.drain, count)
            with adapter() as name, slcanBus(name, bitrate=500_000, sleep_after_open=0.0) as peer:
                time.sleep(0.1)
                peer.flush()
                theirs[way] += measure(peer, peer.serialPortOrig, take_theirs, period, count)
                theirs_empty += poll_empty(lambda: peer.recv(0.0), count // 10)
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
