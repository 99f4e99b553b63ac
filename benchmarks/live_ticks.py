"""Measure the time that the loop needs for the live page in a tick."""

from __future__ import annotations

import mmap
import time

import numpy as np

from teleop.live.cells import SIZE, CellReader
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import Stream
from teleop.trial.assembly import make_clock, make_controller, make_layout, make_simulated_rig
from teleop.trial.loop import Loop
from teleop.trial.page_requests import PageRequests
from teleop.trial.readers import Readers
from teleop.trial.stop_switch import StopSwitch

TICKS = 2000
"""Number of ticks of a loop."""


def report(name: str, values: list[float], unit: str, aim: str) -> None:
    """Print median, 99th percentile and maximum of measured values."""
    middle, high, most = np.percentile(values, [50, 99, 100])
    print(
        f"{name:<44} p50 {middle:6.1f}  p99 {high:6.1f}  max {most:6.1f} {unit:<3}"
        f" n {len(values):<4} aim {aim}",
        flush=True,
    )


def parts() -> None:
    """Print the time that a tick needs for the shared memory: the stream and the page's cells."""
    loop = make_loop(0, False)
    record = loop.controller.tick(loop._clock.wait())
    requests = PageRequests(CellReader(mmap.mmap(-1, SIZE)), by_page=True)
    write = loop._stream.write
    for name, call in (("stream", lambda: write(record)), ("cells", requests.read)):
        durations = []
        for _ in range(20_000):
            start = time.perf_counter_ns()
            call()
            durations.append((time.perf_counter_ns() - start) * 1e-3)
        report(f"{name}, in a tick", durations, "us", "+4 us at most for the cells")


def ticks(times: int) -> None:
    """Print the duration of a tick without and with a page. Two loops run in turns."""
    durations: tuple[list[float], list[float]] = ([], [])
    for seed in range(times):
        loops = [make_loop(seed, paged) for paged in (False, True)]
        for _ in range(TICKS):
            for loop, found in zip(loops, durations, strict=True):
                start = time.perf_counter_ns()
                loop.step()
                found.append((time.perf_counter_ns() - start) * 1e-3)
    one, two = (float(np.median(found)) for found in durations)
    print(
        f"a tick, alternating: {one:.1f} us without, {two:.1f} us with the cells of a page: "
        f"{two - one:+.1f} us, aim +4 us at most",
        flush=True,
    )


def make_loop(seed: int, paged: bool) -> Loop:
    """Return a loop in virtual time without readers, with or without a page."""
    settings = TrialSettings(clock="virtual", seed=seed)
    clock, switch = make_clock(settings), StopSwitch()
    layout = make_layout(settings, settings.estimation_preset.bank())
    if paged:
        switch.page = PageRequests(CellReader(mmap.mmap(-1, SIZE)), by_page=False)
    rig = make_simulated_rig(settings, clock.now)
    rig.open()
    controller = make_controller(settings, rig, clock)
    stream = Stream(layout, TICKS)
    return Loop(controller, clock, stream, Readers(), switch, settings.duration)
