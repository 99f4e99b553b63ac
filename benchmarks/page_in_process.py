"""Define a live page whose server runs in this process, on the time of a simulated clock.

`InProcess` is the `LiveLink` of the package, without its process and its sockets. The messages of
the page take the same way as in the live process: the parser, the server with the control of the
pages, the feed, and the cells, which `PageRequests` reads in the loop. The memory of the cells and
rings is private: a process that forks gets its own copy.
"""

from __future__ import annotations

import math
import mmap
import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

from sim_backend import PointerOperator
from teleop.json_documents import dumps, loads
from teleop.live.cells import CellWriter
from teleop.live.clients import Client
from teleop.live.control import Control
from teleop.live.requests import BadRequest, parse_request
from teleop.live.ring import SLOTS, RingReader
from teleop.live.server import PERIOD, Server
from teleop.live.trial_feed import TrialFeed
from teleop.recording.message import Layout
from teleop.trial import live_link
from teleop.trial.live_link import EVENT_SIZE, EVENT_SLOTS, LiveLink
from teleop.trial.page_pointer import PagePointer
from teleop.trial.page_requests import PageRequests
from teleop.trial.settings import TrialSettings

BEAT = 0.25
"""Time between two heartbeats of a page [s]."""
FLOOD = 2000
"""Number of messages of a page that floods, at once."""


class PrivateFile:
    """Replaces `SharedFile`: private memory, which a forked process does not share."""

    path = Path("private")

    def __init__(self, size: int) -> None:
        self.buffer = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)

    @classmethod
    def create(cls, size: int) -> PrivateFile:
        return cls(size)

    def remove(self) -> None: ...


class NoProcess:
    """Replaces the live process for `LiveLink`. It has already sent its address."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.pid = os.getpid()
        output, ready = os.pipe()
        with os.fdopen(ready, "wb") as pipe:
            pipe.write(dumps({"url": "in this process"}).encode() + b"\n")
        self.stdout = os.fdopen(output, "rb", 0)
        self.stdin = Path(os.devnull).open("wb", 0)  # noqa: SIM115

    def wait(self, timeout: float) -> int:
        return 0


class PageClient(Client):
    """A page without a connection. It discards all data that it receives."""

    unsent = 0

    def send(self, document: dict[str, Any]) -> None: ...

    def send_rows(self, *arguments: Any) -> None: ...


class InProcess(LiveLink):
    """A live page whose server runs in this process.

    Parameters
    ----------
    layout
        Layout of the message of a tick.
    by_page, pointer
        As for `LiveLink`.
    now
        Function that returns the simulated time [s].

    Attributes
    ----------
    cells
        Writes to the cells directly, as a live process that has gone wrong would do.
    runs
        Whether the live process runs; False if it hangs or was killed.
    beats
        Whether the page sends heartbeats.
    """

    def __init__(
        self, layout: Layout, by_page: bool, pointer: bool, now: Callable[[], float]
    ) -> None:
        choices: dict[str, list[Any]] = {"condition": [], "specimen": [], "duration": []}
        with (
            mock.patch.object(live_link, "SharedFile", PrivateFile),
            mock.patch.object(live_link.subprocess, "Popen", NoProcess),
        ):
            super().__init__(layout.size, "", 0, by_page, pointer, choices)
        self._now = now
        welcome = {"may_arm": by_page, "pointer": pointer, "choices": choices}
        self.counts: Any = self._cells.counts
        self.cells = CellWriter(self.counts.obj)
        self._feed = TrialFeed(
            RingReader(self._ring._buffer, SLOTS, layout.size),
            RingReader(self._events._buffer, EVENT_SLOTS, EVENT_SIZE),
            self.cells,
            welcome,
            lambda request: None,
        )
        self._server = Server(self._feed, "", {})
        self._server.control = Control(now)
        self._due = self._beat_due = -math.inf
        self._client: PageClient | None = None
        self._waiting: list[str] = []
        self.runs = self.beats = True
        self.connect()

    def make_operator(self) -> PointerOperator | None:
        return PointerOperator(PagePointer(self._cells, self._now)) if self._has_pointer else None

    def begin(self, settings: TrialSettings, layout: Layout) -> PageRequests:
        super().begin(settings, layout)
        return PageRequests(self._cells, self._by_page, self._stops, self._now)

    def tell(self, document: dict[str, Any]) -> None:
        if self.trials and self.runs:
            self._feed.receive(loads(dumps(document)))

    def advance(self) -> None:
        """Run the live process and the page until the present time."""
        now = self._now()
        if self.runs and now >= self._due:
            self._due = now + PERIOD
            self._server.fan_out()
        if self.beats and now >= self._beat_due:
            self._beat_due = now + BEAT
            self.send("beat", n=1)

    def send(self, kind: str, **fields: Any) -> None:
        """Send a request of the page, if the page is connected."""
        self.receive(dumps({"type": kind, **fields}))

    def receive(self, message: str) -> None:
        """Receive a message of the page, as the server does."""
        if not self._client:
            return
        if not self.runs:
            self._waiting.append(message)
            return
        try:
            if self._client.is_flooding():
                self.disconnect()
            else:
                self._server._receive(self._client, parse_request(message))
        except BadRequest:
            self.disconnect()

    def connect(self) -> None:
        """Connect a new page in place of the present one."""
        self.disconnect()
        self._waiting.clear()
        connection: Any = SimpleNamespace()
        self._client = PageClient(connection, self._now)
        self._server._clients.add(self._client)

    def disconnect(self) -> None:
        """Close the connection of the page."""
        client, self._client = self._client, None
        if client:
            self._server._clients.discard(client)
            if self.runs and self._server.control.holder is client:
                self._server._lose_control()

    def arm(self) -> None:
        """Take control, and press UNLOCK and START."""
        for kind in ("control", "unlock", "start"):
            self.send(kind)

    def silence(self) -> None:
        """Send no more heartbeats."""
        self.beats = False

    def flood(self) -> None:
        for n in range(FLOOD):
            self.send("ping", at=n)

    def flood_another(self) -> None:
        """Let another page, which has no control, send too many messages."""
        own, self._client = self._client, None
        self.connect()
        self.flood()
        self._client = own

    def kill(self) -> None:
        """Stop the live process."""
        self.runs = False

    suspend = kill

    def resume(self) -> None:
        """Continue the live process, which first receives the messages that have waited."""
        self.runs = True
        waiting, self._waiting = self._waiting, []
        for message in waiting:
            self.receive(message)
