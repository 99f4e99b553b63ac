"""Measure the lateness of the loop without and with live pages, in turns within one trial.

On a shared machine, the 99.9th percentile of the lateness changes by a factor of ten within a
minute. Therefore short blocks of each case follow each other in random order. Two cases show how
much of a difference is due to the page: one without a page, in which another process uses as much
processor time, and one with a client of another project instead of a page.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from live_session import Session, flooding, now, session
from robo_ws_bridge import WebSocketBridgeClient

from teleop.recording.recording import load

LENGTH = 2.5
"""Length of a block [s]."""
SETTLE = 0.5
"""Time from the start of a case to its first sample [s]."""
RESAMPLED = 2000
"""Number of samples of the bootstrap."""
LOAD = """
import time
while True:
    start = time.perf_counter()
    while time.perf_counter() - start < 0.0008: pass
    time.sleep(1 / 60 - 0.0008)
"""
"""Source of a process that wakes 60 times a second and uses 5 % of a processor."""
CASES = {
    "without": "live process suspended",
    "load": "the same, another process uses 5 % of a processor",
    "foxglove": "one Foxglove client",
    "one": "one page",
    "eight": "8 pages, one flooding",
}


class Block(NamedTuple):
    """A part of the trial, on the clock of the column `sent` [s]."""

    case: str
    start: float
    end: float


@contextlib.contextmanager
def suspended(pid: int) -> Iterator[None]:
    """Suspend a process within the block."""
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


@contextlib.contextmanager
def load_process() -> Iterator[None]:
    """Run a process that uses processor time within the block."""
    with subprocess.Popen([sys.executable, "-c", LOAD]) as process:
        try:
            yield
        finally:
            process.kill()


@contextlib.asynccontextmanager
async def foxglove_client(url: str) -> AsyncIterator[None]:
    """Subscribe to all ticks within the block, with the client of another project."""
    client, sizes = WebSocketBridgeClient(url, subprotocol="foxglove.sdk.v1"), []

    async def receive(_channel: object, _timestamp: object, payload: Any) -> None:
        sizes.append(len(payload))

    client.on_message(receive)
    await client.connect()
    for topic in ("/tick", "/tick_60hz"):
        await client.subscribe(topic)
    yield
    await client.disconnect()
    if not sizes:
        raise ConnectionError(f"{url}: the Foxglove client received no tick")


async def measured(running: Session, case: str) -> Block:
    """Return the block in which a case was applied to the running trial."""
    async with contextlib.AsyncExitStack() as stack:
        if case in ("without", "load"):
            stack.enter_context(suspended(running.live))
        if case == "load":
            stack.enter_context(load_process())
        if case == "foxglove":
            await stack.enter_async_context(foxglove_client(running.foxglove))
        for _ in range({"one": 1, "eight": 7}.get(case, 0)):
            await stack.enter_async_context(running.page())
        if case == "eight":
            await stack.enter_async_context(flooding(running))
        await asyncio.sleep(SETTLE)
        start = now()
        await asyncio.sleep(LENGTH)
        return Block(case, start, now())


async def trial(path: Path, turns: int) -> tuple[list[Block], float]:
    """Record a trial with blocks of all cases; return them, and the start of the trial [s]."""
    options = ("--duration", "36000", "--yes", "--foxglove", "--record", str(path))
    with session(*options) as running:
        async with running.page() as page:
            await page.until("active")
            await asyncio.sleep(1.0)
            start = float(np.median(page.column("sent") - page.column("time")))
        order = [case for _ in range(turns) for case in random.sample([*CASES], len(CASES))]
        blocks = [await measured(running, case) for case in order]
        running.process.send_signal(signal.SIGINT)
        running.process.communicate(timeout=90.0)
    return blocks, start


def percentile(late: np.ndarray) -> float:
    """Return the 99.9th percentile."""
    return float(np.percentile(late, 99.9))


def ratio(case: np.ndarray, reference: np.ndarray) -> str:
    """Return the median of the ratios of paired values, and its 95 % bootstrap interval."""
    ratios = case / reference
    draws = np.random.default_rng(0).choice(ratios, (RESAMPLED, len(ratios)))
    low, high = np.percentile(np.median(draws, axis=1), [2.5, 97.5])
    return f"{np.median(ratios):.2f} ({low:.2f} to {high:.2f})"


def lateness(turns: int) -> None:
    """Print the lateness of the loop and the duration of a tick in each case."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lateness.mcap"
        blocks, start = asyncio.run(trial(path, turns))
        recording = load(path)
    time = recording["time"] + start
    late, busy = (1e6 * recording[name] for name in ("lateness", "busy_time"))
    rows = {
        case: [(block.start <= time) & (time < block.end) for block in blocks if block.case == case]
        for case in CASES
    }
    tails = {case: np.array([percentile(late[part]) for part in rows[case]]) for case in CASES}
    print(
        f"p99.9 of the lateness in {turns} blocks of {LENGTH:g} s: median [us]; median of the "
        "ratios in a turn (95 % interval)\nto the case without a page, aim <= 1.2, and to a "
        "Foxglove client; p99.9 of all ticks [us]; p50 of the duration of a tick [us]"
    )
    for case, text in CASES.items():
        every = np.logical_or.reduce(rows[case])
        print(
            f"{text:<50} {np.median(tails[case]):7.1f}  {ratio(tails[case], tails['without']):<22} "
            f"{ratio(tails[case], tails['foxglove']):<22} {percentile(late[every]):7.1f} "
            f"{np.median(busy[every]):7.1f}",
            flush=True,
        )
