"""Measure the time that the loop needs for the live page in a tick."""

from __future__ import annotations

import mmap
import time

import numpy as np

from teleop.live.cells import SIZE, CellReader
from teleop.streams.ring import SLOTS, RingWriter, ring_size
from teleop.streams.columns import Layout
from teleop.recording.sinks import Memory, Sink
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_clock, make_controller, make_simulated_rig
from teleop.trial.loop import Loop
from teleop.trial.page_requests import PageRequests
from teleop.trial.stop_switch import StopSwitch


def report(name: str, values: list[float], unit: str, aim: str) -> None:
    """Print median, 99th percentile and maximum of measured values."""
    middle, high, most = np.percentile(values, [50, 99, 100])
    print(
        f"{name:<44} p50 {middle:6.1f}  p99 {high:6.1f}  max {most:6.1f} {unit:<3}"
        f" n {len(values):<4} aim {aim}",
        flush=True,
    )


def parts() -> None:
    """Print the time that a tick needs for the shared memory of the live page, ring and cells."""
    message = bytes(500)
    ring = RingWriter(mmap.mmap(-1, ring_size(SLOTS, len(message))), SLOTS, len(message))
    requests = PageRequests(CellReader(mmap.mmap(-1, SIZE)), by_page=True)
    for name, call in (("ring", lambda: ring.write(message)), ("cells", requests.read)):
        durations = []
        for _ in range(20_000):
            start = time.perf_counter_ns()
            call()
            durations.append((time.perf_counter_ns() - start) * 1e-3)
        report(f"{name}, in a tick", durations, "us", "+4 us at most together")


def ticks(times: int) -> None:
    """Print the duration of a tick without and with ring and cells. Two loops run in turns."""
    durations: tuple[list[float], list[float]] = ([], [])
    for seed in range(times):
        loops = [make_loop(seed, paged) for paged in (False, True)]
        for _ in range(2000):
            for loop, found in zip(loops, durations, strict=True):
                start = time.perf_counter_ns()
                loop.step()
                found.append((time.perf_counter_ns() - start) * 1e-3)
    one, two = (float(np.median(found)) for found in durations)
    print(
        f"a tick, alternating: {one:.1f} us without, {two:.1f} us with ring and cells: "
        f"{two - one:+.1f} us, aim +4 us at most",
        flush=True,
    )


def make_loop(seed: int, paged: bool) -> Loop:
    """Return a loop in virtual time that stores its ticks in memory, with or without a page."""
    settings = TrialSettings(clock="virtual", seed=seed)
    clock, bank = make_clock(settings), settings.estimation_preset.bank()
    layout, switch = Layout(bank), StopSwitch()
    sinks: list[Sink] = [Memory()]
    if paged:
        cells = mmap.mmap(-1, SIZE)
        switch.page = PageRequests(CellReader(cells), by_page=False)
        sinks.append(RingSink(layout.size))
    rig = make_simulated_rig(settings, clock.now)
    rig.open()
    controller = make_controller(settings, rig, bank, clock)
    return Loop(controller, clock, layout, sinks, switch, settings.duration)


class RingSink(Memory):
    """Writes the ticks to a ring, as `LiveLink` does."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self._ring = RingWriter(mmap.mmap(-1, ring_size(SLOTS, size)), SLOTS, size)

    def push(self, message: bytes) -> None:
        self._ring.write(message)
