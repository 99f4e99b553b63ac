"""Measure the live page without a browser: latencies, processor time, and effect on the loop.

    python benchmarks/live.py                    # all measurements, about twelve minutes
    python benchmarks/live.py --times 3 --seconds 5 --turns 3

Each result is printed next to its aim:

- the time from STOP of a page to the commanded stop, with and without a client that sends too many
  messages (flood);
- the time from SIGKILL or SIGSTOP of the live process to the beginning of the ramp;
- the time from the last sample of the pointer to the release of the handle;
- the processor time of the live process;
- the lateness of the loop and the duration of a tick, in turns without and with pages.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import random
import signal
import subprocess
import tempfile
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import numpy as np
from live_lateness import lateness
from live_session import Page, flooding, now, session
from live_ticks import parts, report, ticks
from websockets.exceptions import ConnectionClosed

from teleop.recording.recording import load

FAULT = 5
LONG = ("--duration", "600", "--no-record")


def fault_time(path: Path, page: Page) -> float:
    """Return the time of the first tick in mode fault, on the clock of the column `sent` [s]."""
    recording = load(path)
    offset = float(np.median(page.column("sent") - page.column("time")))
    return float(recording["time"][recording["mode"] == FAULT][0]) + offset


def repeated(times: int, measure: Callable[[int], Coroutine[Any, Any, float]]) -> list[float]:
    """Return measured values. A measurement that fails on a busy machine is repeated."""
    found: list[float] = []
    for number in range(3 * times):
        try:
            found.append(asyncio.run(asyncio.wait_for(measure(number), 60.0)))
        except (ConnectionError, TimeoutError, IndexError, subprocess.TimeoutExpired) as error:
            print(f"not measured: {error or type(error).__name__}", flush=True)
        if len(found) == times:
            break
    return found


async def stop(number: int, folder: Path, flooded: bool) -> float:
    """Return the time from STOP to the commanded stop [ms]."""
    path = folder / f"stop-{flooded}-{number}.mcap"
    with session("--duration", "600", "--record", str(path)) as running:
        others = flooding(running) if flooded else contextlib.nullcontext()
        async with others, running.page() as page:
            await page.arm()
            await asyncio.sleep(random.uniform(1.0, 1.2))
            pressed = now()
            await page.send("stop")
            await page.until("ended")
        running.process.communicate(timeout=90.0)
        return 1e3 * (fault_time(path, page) - pressed)


async def death(number: int, folder: Path) -> float:
    """Return the time from SIGKILL or SIGSTOP of the live process to the start of the ramp [ms]."""
    path = folder / f"death-{number}.mcap"
    with session("--duration", "600", "--record", str(path)) as running:
        died = 0.0
        try:
            async with running.page() as page:
                await page.arm()
                await asyncio.sleep(random.uniform(1.0, 1.2))
                died = now()
                os.kill(running.live, (signal.SIGKILL, signal.SIGSTOP)[number % 2])
        except ConnectionClosed:
            if not died:
                raise ConnectionError("the command ended before it was armed") from None
        running.process.communicate(timeout=90.0)
        return 1e3 * (fault_time(path, page) - died)


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--turns", type=int, default=30, help="blocks of each case of the lateness")
    options = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors")
    parts()
    ticks(options.times)
    with tempfile.TemporaryDirectory() as name:
        folder, times = Path(name), options.times
        quiet = repeated(times, lambda number: stop(number, folder, False))
        report("STOP to stop", quiet, "ms", "p99 20, max 100")
        flooded = repeated(times, lambda number: stop(number, folder, True))
        report("STOP to stop, flood", flooded, "ms", "max 50")
        died = repeated(times, lambda number: death(number, folder))
        report("live process dead to ramp", died, "ms", "max 350")
        report("silent hand to release", asyncio.run(silences(times, folder)), "ms", "max 200")
    asyncio.run(processor_time(options.seconds))
    lateness(options.turns)


if __name__ == "__main__":
    main()
