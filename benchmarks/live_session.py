"""Run `teleop run --live` and connect pages to it, for the measurements of the live page."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import struct
import subprocess
import sys
import time
from collections import deque
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from websockets.asyncio.client import connect

TICK = 1.0 / os.sysconf("SC_CLK_TCK")


class Page:
    """A connected page. It receives messages in its own task."""

    def __init__(self, connection: Any) -> None:
        self.connection = connection
        self.state: dict[str, Any] = {}
        self.names: list[str] = []
        self.summary: dict[str, Any] = {}
        self.rows: list[np.ndarray] = []
        self.seen = 0.0
        self.delay = 0.0
        """Delay of the heartbeats [s]."""
        self.task = asyncio.create_task(self._receive())
        self.beats = asyncio.create_task(self._beat())

    async def send(self, kind: str, **fields: Any) -> None:
        await self.connection.send(json.dumps({"type": kind, **fields}))

    async def until(self, mode: str) -> None:
        """Wait for a mode; raise ConnectionError if the command ends first."""
        while self.state.get("mode") != mode:
            if self.task.done():
                raise ConnectionError(f"the command ended before the mode {mode}")
            await asyncio.sleep(0.002)

    async def arm(self) -> None:
        """Take control, and arm the drives."""
        await self.send("control")
        await self.until("ready")
        await self.send("beat", seen=self.seen, at=0.0)
        await self.send("unlock")
        await self.send("start")
        await self.until("active")

    def column(self, name: str) -> np.ndarray:
        rows = np.vstack(self.rows)
        return rows[:, self.names.index(name)]

    async def _receive(self) -> None:
        async for message in self.connection:
            if isinstance(message, bytes):
                _, count, columns, clear, self.seen = struct.unpack_from("<IIIId", message)
                rows = np.frombuffer(message, "<f8", offset=24).reshape(count, columns)
                self.rows = [rows] if clear else [*self.rows[-600:], rows]
                continue
            document = json.loads(message)
            if document["type"] == "state":
                self.state = document
            elif document["type"] == "welcome":
                self.names = [column["name"] for column in document["columns"]]
            elif document["type"] == "summary":
                self.summary = document

    async def _beat(self) -> None:
        waiting: deque[tuple[float, float]] = deque()
        while True:
            waiting.append((now() + self.delay, self.seen))
            while waiting and now() >= waiting[0][0]:
                await self.send("beat", seen=waiting.popleft()[1], at=0.0)
            await asyncio.sleep(0.05)


@contextlib.asynccontextmanager
async def connected(address: str, token: str, kind: type[Page] = Page) -> AsyncIterator[Any]:
    """Open a page of a server within the block."""
    async with connect(
        f"ws://{address}/ws", origin=f"http://{address}", compression=None
    ) as connection:
        await connection.send(json.dumps({"type": "hello", "token": token, "view": "main"}))
        page = kind(connection)
        try:
            yield page
        finally:
            page.task.cancel()
            page.beats.cancel()
            await asyncio.gather(page.task, page.beats, return_exceptions=True)


class Session:
    """A running command with a live page."""

    def __init__(self, process: subprocess.Popen[str], lines: str) -> None:
        page = re.search(r"http://(\S+)/#t=(\w+)", lines)
        viewer = re.search(r"Foxglove: (\S+)", lines)
        assert page
        self.process = process
        self.address, self.token = page.groups()
        self.foxglove = viewer[1] if viewer else ""
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        (self.live,) = [
            int(child)
            for child in children
            if b"teleop.live.process" in Path(f"/proc/{child}/cmdline").read_bytes()
        ]

    def page(self) -> contextlib.AbstractAsyncContextManager[Page]:
        """Open a page within a block."""
        return connected(self.address, self.token)

    def cpu(self) -> float:
        """Return the processor time of the live process so far [s]."""
        fields = Path(f"/proc/{self.live}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) * TICK


@contextlib.contextmanager
def session(*options: str) -> Iterator[Session]:
    """Run `teleop run --live` with options within the block."""
    command = [sys.executable, "-m", "teleop", "run", "--live", *options]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr
        try:
            lines = ""
            while "live page: " not in lines:
                lines += next(process.stderr)
            yield Session(process, lines)
        finally:
            process.terminate()
            process.communicate()


async def flood(running: Session) -> None:
    """Send messages until cancelled: alternately just below the rate limit, and far above it."""
    for number in range(10**9):
        with contextlib.suppress(Exception):
            async with running.page() as page:
                most = 390 if number % 2 else 10_000
                for n in range(20 * most):
                    await page.send("beat", seen=0.0, at=n)
                    if most == 390 or n % 50 == 0:
                        await asyncio.sleep(1.0 / most)
        await asyncio.sleep(0.05)


@contextlib.asynccontextmanager
async def flooding(running: Session) -> AsyncIterator[None]:
    """Send too many messages within the block."""
    task = asyncio.create_task(flood(running))
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def now() -> float:
    """Return the present time of the clock with which the loop writes the column `sent` [s]."""
    return time.monotonic()
