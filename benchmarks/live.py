"""The live page without a browser: latencies, processor time, and its effect on the loop.

    python benchmarks/live.py                    # all measurements, about four minutes
    python benchmarks/live.py --times 3 --seconds 5
    python benchmarks/live.py --minutes 30       # pages that come and go: memory, descriptors

Measured in one run, each next to its aim: the time from STOP of a page to the commanded stop, with
and without a flooding client; from the death of the live process to the beginning of the ramp; from
the last sample of the pointer to the release of the handle; the processor time of the live process;
and, in turns with runs without a page, the lateness of the loop and the duration of a tick.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import mmap
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from live_session import Page, flood, now, session

from teleop.live.cells import SIZE, CellReader
from teleop.live.ring import SLOTS, RingWriter, ring_size
from teleop.recording.message import Layout
from teleop.recording.recording import load
from teleop.recording.sinks import Memory, Sink
from teleop.trial.assembly import make_clock, make_controller, make_simulated_rig
from teleop.trial.loop import Loop
from teleop.trial.page_requests import PageRequests
from teleop.trial.settings import TrialSettings
from teleop.trial.stop_switch import StopSwitch

FAULT = 5
LONG = ("--duration", "600", "--no-record")


def report(name: str, values: list[float], unit: str, aim: str) -> None:
    """Print median, 99th percentile and maximum of measured values."""
    middle, high, most = np.percentile(values, [50, 99, 100])
    print(
        f"{name:<44} p50 {middle:6.1f}  p99 {high:6.1f}  max {most:6.1f} {unit:<3}"
        f" n {len(values):<4} aim {aim}",
        flush=True,
    )


def fault_time(path: Path, page: Page) -> float:
    """Return the time of the first tick in mode fault, on the clock of the column `sent` [s]."""
    recording = load(path)
    offset = float(np.median(page.column("sent") - page.column("time")))
    return float(recording["time"][recording["mode"] == FAULT][0]) + offset


async def stops(times: int, folder: Path, flooding: bool) -> list[float]:
    """Return the times from STOP to the commanded stop [ms]."""
    found = []
    for number in range(times):
        path = folder / f"stop-{flooding}-{number}.mcap"
        with session("--duration", "600", "--record", str(path)) as running:
            task = asyncio.create_task(flood(running)) if flooding else None
            async with running.page() as page:
                await page.arm()
                await asyncio.sleep(random.uniform(1.0, 1.2))
                pressed = now()
                await page.send("stop")
                await page.until("ended")
                found.append(1e3 * (fault_time(path, page) - pressed))
            if task:
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)
    return found


async def deaths(times: int, folder: Path) -> list[float]:
    """Return the times from the death of the live process to the beginning of the ramp [ms]."""
    found = []
    for number in range(times):
        path = folder / f"death-{number}.mcap"
        with session("--duration", "600", "--record", str(path)) as running:
            with contextlib.suppress(Exception):
                async with running.page() as page:
                    await page.arm()
                    await asyncio.sleep(random.uniform(1.0, 1.2))
                    died = now()
                    os.kill(running.live, (signal.SIGKILL, signal.SIGSTOP)[number % 2])
            running.process.communicate()
            found.append(1e3 * (fault_time(path, page) - died))
    return found


async def silences(times: int, folder: Path) -> list[float]:
    """Return the times from the last sample of the pointer to the release of the handle [ms]."""
    path = folder / "pointer.mcap"
    sent = []
    with session(
        "--duration", str(2.0 + times), "--operator", "pointer", "--record", str(path)
    ) as running:
        async with running.page() as page:
            await page.arm()
            for _ in range(times):
                for n in range(30):
                    await page.send("pointer", depth=0.004 + 0.0001 * n, grip=True)
                    sent.append(now())
                    await asyncio.sleep(1.0 / 60.0)
                sent = [*sent[: len(sent) - 30], sent[-1]]
                await asyncio.sleep(0.4)
            offset = float(np.median(page.column("sent") - page.column("time")))
            await page.until("ended")
    recording = load(path)
    released = recording["time"][1:][np.diff(recording["pointer_grip"]) < 0.0] + offset
    return [1e3 * float(released[released > last][0] - last) for last in sent]


async def processor_time(seconds: float) -> None:
    """Print the share of a processor that the live process needs with one and eight pages."""
    with session(*LONG, "--yes") as running:
        async with contextlib.AsyncExitStack() as pages:
            for count, aim in ((1, "<= 5"), (8, "<= 8")):
                for _ in range(count - (count > 1)):
                    page = await pages.enter_async_context(running.page())
                await page.until("active")
                await asyncio.sleep(1.0)
                start, before = now(), running.cpu()
                await asyncio.sleep(seconds)
                share = 100.0 * (running.cpu() - before) / (now() - start)
                print(f"live process with {count} page(s): {share:.1f} % of a processor, aim {aim}")


async def with_pages(seconds: float) -> dict[str, Any]:
    """Return the summary of a run with eight pages, one of which floods."""
    with session("--duration", str(seconds), "--no-record", "--yes") as running:
        async with contextlib.AsyncExitStack() as pages:
            for _ in range(7):
                page = await pages.enter_async_context(running.page())
            task = asyncio.create_task(flood(running))
            while not page.summary:
                await asyncio.sleep(0.05)
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            return page.summary


def without_page(seconds: float) -> dict[str, Any]:
    """Return the summary of a run without a page."""
    command = [sys.executable, "-m", "teleop", "run", "--no-record", "--json"]
    done = subprocess.run(
        [*command, "--duration", str(seconds)], capture_output=True, text=True, check=False
    )
    return dict(json.loads(done.stdout))


def pairs(times: int, seconds: float) -> None:
    """Print lateness and duration of a tick with and without pages, in turns."""
    rows = []
    for _ in range(times):
        for summary in (without_page(seconds), asyncio.run(with_pages(seconds))):
            loop = summary["loop"]
            rows.append((loop["lateness_us"]["p99_9"], loop["tick_us"]["busy"]["p50"]))
    bare, paged = np.array(rows[::2]), np.array(rows[1::2])
    for place, name in enumerate(("lateness p99.9", "duration of a tick p50")):
        one, two = np.median(bare[:, place]), np.median(paged[:, place])
        aim = "ratio <= 1.2" if place == 0 else "+4 us at most"
        print(
            f"{name}: {one:.1f} us without, {two:.1f} us with 8 pages, one flooding: "
            f"ratio {two / one:.2f}, difference {two - one:+.1f} us, aim {aim}"
        )


def parts() -> None:
    """Print the time that the loop needs for ring and cells in a tick."""
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
    """Print the duration of a tick of two loops in virtual time that alternate tick by tick."""
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


async def soak(minutes: float) -> None:
    """Print the growth of memory and descriptors while pages come and go."""
    end = now() + 60.0 * minutes
    with session("--duration", str(60.0 * minutes + 60.0), "--no-record", "--yes") as running:

        async def come_and_go() -> int:
            count = 0
            while now() < end:
                async with running.page():
                    await asyncio.sleep(random.uniform(0.5, 20.0))
                count += 1
            return count

        async with running.page() as page:
            visitors = [asyncio.create_task(come_and_go()) for _ in range(7)]
            await asyncio.sleep(min(60.0, 12.0 * minutes))
            memory = running.memory()
            count = sum(await asyncio.gather(*visitors))
            await asyncio.sleep(2.0)
            alone = running.descriptors()
            print(
                f"{minutes:g} min, {count} visits: memory {running.memory() - memory:+.2f} MB (aim "
                f"+1), {alone} descriptors with one page, {page.state['health']}"
            )
        await asyncio.sleep(1.0)
        print(f"{running.descriptors()} descriptors without a page")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--minutes", type=float)
    options = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors")
    if options.minutes:
        asyncio.run(soak(options.minutes))
        return
    parts()
    ticks(options.times)
    with tempfile.TemporaryDirectory() as name:
        folder, times = Path(name), options.times
        report("STOP to stop", asyncio.run(stops(times, folder, False)), "ms", "p99 20, max 100")
        report("STOP to stop, flood", asyncio.run(stops(times, folder, True)), "ms", "max 50")
        report("live process dead to ramp", asyncio.run(deaths(times, folder)), "ms", "max 350")
        report("silent hand to release", asyncio.run(silences(times, folder)), "ms", "max 200")
    asyncio.run(processor_time(options.seconds))
    pairs(max(3, options.times // 5), options.seconds)


if __name__ == "__main__":
    main()
