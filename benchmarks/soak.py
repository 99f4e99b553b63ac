"""Run the live loop for a long time, and report dropped ticks, memory and descriptors.

    python benchmarks/soak.py --minutes 30                # at 1 kHz
    python benchmarks/soak.py --minutes 10 --rate 4000
    python benchmarks/soak.py --minutes 30 --live         # with pages that come and go

`teleop run` runs in real time and records, while another process keeps the other processor busy.
The memory and the open descriptors of each of its processes (loop, recorder, estimation, live
process) are measured every second. Their growth is the median memory in the last tenth of the run,
minus the median memory in a tenth of the run that begins after the first minute, or the first fifth
of the run. The peak is the largest value after this time, minus the same median. With `--live`,
eight pages are opened and closed at random.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from datetime import date
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from live_session import Session, now, session
from loop import busy, histogram
from watched_trial import readers_of
from websockets.exceptions import ConnectionClosed, InvalidHandshake

PAGES = 8
WARM = 60.0
"""Longest time before the growth is measured [s]."""


class Usage(NamedTuple):
    """Memory and open descriptors of a process at one time."""

    time: float
    """Time since the start of the run [s]."""
    memory: float
    """Resident memory [MB]."""
    descriptors: int


def usage(pid: int, time: float) -> Usage:
    """Return the memory and the number of open descriptors of a process at a given time [s]."""
    process = Path(f"/proc/{pid}")
    pages = int((process / "statm").read_text().split()[1])
    memory = pages * os.sysconf("SC_PAGE_SIZE") / 2**20
    return Usage(time, memory, sum(1 for _ in (process / "fd").iterdir()))


async def measure(process: subprocess.Popen[str], seconds: float) -> dict[str, list[Usage]]:
    """Return the usage of each process of a run, until shortly before its end."""
    found: dict[str, list[Usage]] = {}
    start = time.monotonic()
    while (elapsed := time.monotonic() - start) < seconds - 2.0 and process.poll() is None:
        with contextlib.suppress(OSError):  # a process ended
            for name, pid in {"loop": process.pid, **readers_of(process.pid)}.items():
                found.setdefault(name, []).append(usage(pid, elapsed))
        await asyncio.sleep(1.0)
    return found


async def come_and_go(running: Session, end: float) -> int:
    """Open and close pages until a time [s], and return their number."""
    count = 0
    while now() < end:
        with contextlib.suppress(ConnectionClosed, InvalidHandshake, OSError):
            async with running.page():
                await asyncio.sleep(random.uniform(0.5, 20.0))
            count += 1
    return count


async def with_pages(command: list[str], seconds: float) -> tuple[str, dict[str, list[Usage]], int]:
    """Run a trial with pages; return its output, the usage of its processes, and the visits."""
    with session(*command, "--yes") as running:
        end = now() + seconds - 25.0  # the last pages close before the end
        visitors = [asyncio.create_task(come_and_go(running, end)) for _ in range(PAGES)]
        found = await measure(running.process, seconds)
        visits = sum(await asyncio.gather(*visitors))
        out, _ = await asyncio.to_thread(running.process.communicate)
        return out, found, visits


async def without_page(command: list[str], seconds: float) -> tuple[str, dict[str, list[Usage]]]:
    """Run a trial, and return its output and the usage of its processes."""
    process = subprocess.Popen(
        [sys.executable, "-m", "teleop", "run", *command], stdout=subprocess.PIPE, text=True
    )
    found = await measure(process, seconds)
    return process.communicate()[0], found


def report(out: str, found: dict[str, list[Usage]], seconds: float) -> None:
    """Print the results of a run."""
    summary: dict[str, Any] = json.loads(out)
    loop, recording, fault = summary["loop"], summary["recording"], summary["safety"]["fault"]
    late, tick = loop["lateness_us"], loop["tick_us"]["busy"]
    ended = f"{summary['actual_duration_s']:.0f} of {summary['duration_s']:.0f} s"
    print(f"  {ended}, {'no stop' if fault is None else 'stopped: ' + fault['text']}")
    print(
        f"  {recording['dropped']} ticks dropped, {loop['overruns']} overruns, {loop['skipped']} "
        f"periods skipped of {summary['ticks'] + loop['skipped']}, longest gap "
        f"{loop['longest_gap_s'] * 1e3:.1f} ms"
    )
    print(
        f"  lateness p50 {late['p50']:.1f}, p99 {late['p99']:.1f}, p99.9 {late['p99_9']:.1f}, max "
        f"{late['max']:.1f} us; a tick takes p50 {tick['p50']:.1f}, p99 {tick['p99']:.1f} us"
    )
    print(f"  lateness: {histogram(loop['lateness_histogram'])}")
    warm = min(WARM, 0.2 * seconds)
    for name, values in found.items():
        after = [value for value in values if value.time >= warm]
        if not after:
            continue
        tenth = max(len(values) // 10, 1)
        first, last = (
            median(value.memory for value in part) for part in (after[:tenth], values[-tenth:])
        )
        peak = max(value.memory for value in after) - first
        most = max(value.descriptors for value in after)
        print(
            f"  {name:10} {first:6.1f} MB, growth {last - first:+.2f} MB after {warm:.0f} s, peak "
            f"{peak:+.2f} MB; descriptors {after[0].descriptors}, at most {most}, at the end "
            f"{after[-1].descriptors}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--rate", type=float, default=1000.0, help="rate of the loop [Hz]")
    parser.add_argument("--live", action="store_true", help="with pages that come and go")
    options = parser.parse_args()
    seconds = 60.0 * options.minutes
    print(f"# python benchmarks/soak.py {' '.join(sys.argv[1:])}, {date.today()}")
    load = os.getloadavg()[0]
    print(f"{seconds:g} s at {options.rate:g} Hz, second processor busy, load {load:.1f}")
    with tempfile.TemporaryDirectory() as folder, busy(min(os.sched_getaffinity(0))):
        command = [f"--duration={seconds}", f"--rate={options.rate}", "--json"]
        command.append(f"--record={folder}/soak.mcap")
        if options.live:
            out, found, visits = asyncio.run(with_pages(command, seconds))
            print(f"  {visits} visits of {PAGES} pages")
        else:
            out, found = asyncio.run(without_page(command, seconds))
        report(out, found, seconds)


if __name__ == "__main__":
    main()
