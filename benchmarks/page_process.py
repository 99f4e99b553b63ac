"""Define a live page in real time: its live process, and a page that another process opens.

The process of the page runs this file, with the address of the page as its argument. It reads
commands from standard input, one a line.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
from typing import Any

from teleop.trial.live_link import LiveLink
from teleop.trial.page_requests import PAGE_AGE

FLOOD = 20_000
"""Number of messages of a page that floods."""


class PageProcess(LiveLink):
    """A live page with its live process, and a page in a third process.

    The methods are those of `InProcess`.
    """

    def __init__(self, by_page: bool, pointer: bool = False) -> None:
        choices: dict[str, list[Any]] = {"condition": [], "specimen": [], "duration": []}
        super().__init__("127.0.0.1", 0, by_page, pointer, choices)
        self._client = subprocess.Popen(
            [sys.executable, __file__, self.url], stdin=subprocess.PIPE, text=True
        )
        self._arming = False

    def advance(self) -> None: ...

    def arm(self) -> None:
        """Take control, and arm the drives as soon as they are ready."""
        if not self._arming:
            self._arming = True
            self._do("arm")

    def send(self, kind: str) -> None:
        self._do(kind)

    def silence(self) -> None:
        """Send no more heartbeats."""
        self._do("silence")

    def disconnect(self) -> None:
        self._do("disconnect")

    def slow_down(self) -> None:
        """Send all further messages so late that the page is too far behind although it beats."""
        self._do("slow down")

    def flood(self) -> None:
        self._do("flood")

    def flood_another(self) -> None:
        """Let another page, which has no control, send too many messages."""
        self._do("flood another")

    def kill(self) -> None:
        """Kill the live process."""
        os.kill(self.pid, signal.SIGKILL)

    def suspend(self) -> None:
        """Suspend the live process."""
        os.kill(self.pid, signal.SIGSTOP)

    def end(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGCONT)
        self._client.kill()
        self._client.communicate()
        super().end()

    def _do(self, command: str) -> None:
        assert self._client.stdin
        self._client.stdin.write(f"{command}\n")
        self._client.stdin.flush()


async def flood(page: Any) -> None:
    for n in range(FLOOD):
        await page.send("beat", seen=0.0, at=n)


async def client(url: str) -> None:
    """Open a page, and carry out commands until standard input ends."""
    from live_session import connected

    address, token = url.removeprefix("http://").split("/#t=")
    tasks = []
    async with connected(address, token) as page, connected(address, token) as other:
        while command := (await asyncio.to_thread(sys.stdin.readline)).strip():
            with contextlib.suppress(Exception):
                if command == "arm":
                    tasks.append(asyncio.create_task(page.arm()))
                elif command == "silence":
                    page.beats.cancel()
                elif command == "slow down":
                    page.delay = 1.2 * PAGE_AGE
                elif command == "disconnect":
                    page.connection.transport.abort()
                elif command == "flood":
                    tasks.append(asyncio.create_task(flood(page)))
                elif command == "flood another":
                    tasks.append(asyncio.create_task(flood(other)))
                else:
                    await page.send(command)


if __name__ == "__main__":
    with contextlib.suppress(OSError):  # the trial has already ended
        asyncio.run(client(sys.argv[1]))
