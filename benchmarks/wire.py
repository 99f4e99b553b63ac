"""Measure the time per tick to communicate with devices, also with python-can's slcan bus.

    python benchmarks/wire.py                  # 5000 ticks of each at 1 kHz

The devices are emulated in another process (`teleop rig emulate`) and connected by
pseudo-terminals. The time that a tick spends on the communication is measured: `read` reads and
decodes all data of every port, `write` encodes both velocities and sends them. For comparison, the
same frames are sent with python-can's slcan bus. The lateness of a loop without devices, which only
waits for its deadlines, shows the effect of the machine.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import can
import numpy as np
from can.interfaces.slcan import slcanBus
from emulated import emulated

from drivers import STANDSTILL
from drivers.rig_file import read_rig_file
from drivers.wired_rig import WiredRig
from teleop.control.clock import RealClock
from teleop.trial.realtime import realtime

RATE = 1000.0
WARM = 1000
"""Number of ticks before the measured ticks."""


def ours(path: Path, ticks: int) -> dict[str, dict[str, list[float]]]:
    """Return the times to read and write a rig, and to receive all data of each of its buses [s].

    The drives are enabled at standstill.
    """
    clock = RealClock(RATE)
    reads: list[float] = []
    writes: list[float] = []
    both: list[float] = []
    drains: dict[str, list[float]] = {}
    with realtime("try") as real_time, WiredRig(read_rig_file(path), clock.now) as rig:
        real_time.start()
        for name, bus in rig.buses.items():
            drains[name] = []
            bus.poll = timed(bus.poll, drains[name])  # type: ignore[method-assign]
        enabled = False
        for tick in range(ticks + WARM):
            clock.wait()
            start = time.perf_counter()
            rig.read()
            middle = time.perf_counter()
            enabled = enabled or rig.enable()
            before = time.perf_counter()
            rig.write(STANDSTILL)
            end = time.perf_counter()
            if tick >= WARM:
                reads.append(middle - start)
                writes.append(end - before)
                both.append(middle - start + end - before)
    parts = {name: {"read": times[-ticks:]} for name, times in drains.items()}
    return {"": {"read": reads, "write": writes, "both": both}} | parts


def timed(poll: Callable[[], None], times: list[float]) -> Callable[[], None]:
    """Return a function that reads all data of a bus, and appends the duration to `times` [s]."""

    def watched() -> None:
        start = time.perf_counter()
        poll()
        times.append(time.perf_counter() - start)

    return watched


def drain(bus: slcanBus) -> None:
    """Receive all frames; python-can raises ValueError for the incomplete line at the start."""
    while True:
        try:
            if not bus.recv(0):
                return
        except ValueError:
            continue


def peer(path: Path, ticks: int) -> dict[str, list[float]]:
    """Return the times of python-can's slcan bus to receive all frames, and to send two frames."""
    channel = read_rig_file(path).sections.buses["can"].channel
    sent = [
        can.Message(arbitration_id=node << 5 | 0x0D, data=bytes(8), is_extended_id=False)
        for node in (1, 2)
    ]
    clock = RealClock(RATE)
    reads, writes, both = [], [], []
    with (
        realtime("try") as real_time,
        slcanBus(channel, bitrate=1_000_000, sleep_after_open=0.1) as bus,
    ):
        real_time.start()
        for tick in range(ticks + WARM):
            clock.wait()
            start = time.perf_counter()
            drain(bus)
            middle = time.perf_counter()
            for frame in sent:
                bus.send(frame)
            end = time.perf_counter()
            if tick >= WARM:
                reads.append(middle - start)
                writes.append(end - middle)
                both.append(end - start)
    return {"read": reads, "write": writes, "both": both}


def bare(ticks: int) -> list[float]:
    """Return the lateness of each tick of an empty loop [s]."""
    clock = RealClock(RATE)
    with realtime("try") as real_time:
        real_time.start()
        return [clock.wait().lateness for _ in range(ticks)]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--ticks", type=int, default=5000)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    found: dict[str, dict[str, list[float]]] = {}
    for name in ("serial-board", "odrive-bota"):
        with emulated(name) as path:
            for part, times in ours(path, given.ticks).items():
                found[f"  its bus {part}: drain and decode" if part else name] = times
    with emulated("odrive-bota") as path:
        found["the same ODrives, python-can's slcan alone"] = peer(path, given.ticks)
    found["no wire (lateness)"] = {"both": bare(given.ticks)}
    rows = {
        name: {part: tuple(np.percentile(times, (50, 99)) * 1e6) for part, times in parts.items()}
        for name, parts in found.items()
    }
    if given.json:
        print(json.dumps(rows, indent=2))
        return
    print(f"{'[us], p50 / p99':44}{'read':>16}{'write':>16}{'a tick':>16}")
    for name, parts in rows.items():
        cells = (parts.get(part) for part in ("read", "write", "both"))
        print(f"{name:44}" + "".join(f"{c[0]:7.1f} /{c[1]:7.1f}" if c else " " * 16 for c in cells))


if __name__ == "__main__":
    main()
