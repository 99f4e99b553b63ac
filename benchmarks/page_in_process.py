"""Define a live page whose server runs in this process, on the time of a simulated clock.

`InProcess` is the `LiveLink` of the package, without its process and its sockets. The messages of
the page take the same way as in the live process: the parser, the server with the control of the
pages, the feed, and the cells, which `PageRequests` reads in the loop. The memory of the cells is
private: a process that forks gets its own copy. The stream must be a `private_stream`. The
connection delays every message by the same time, and keeps their order.
"""

from __future__ import annotations

import math
import mmap
from collections import deque
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

from sim_backend import PointerOperator
from teleop.json_documents import dumps, loads
from teleop.live import trial_feed
from teleop.live.cells import ARM, SEEN, CellWriter
from teleop.live.clients import Client, Control
from teleop.live.limited_connection import MOST_FRAMES
from teleop.live.requests import BadRequest, parse_request
from teleop.live.server import PERIOD, Server
from teleop.live.trial_feed import TrialFeed
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import Stream, StreamReader
from teleop.trial import live_link
from teleop.trial.live_link import LiveLink
from teleop.trial.page_requests import PAGE_AGE, PagePointer, PageRequests

BEAT = 0.05
"""Shortest time between two heartbeats of a page [s]."""


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
    """Replaces the `ChildProcess` of a `LiveLink`. It stores the messages to the live process."""

    url = "in this process"

    def __init__(self, *arguments: Any) -> None:
        self.told: deque[dict[str, Any]] = deque()

    def tell(self, document: dict[str, Any]) -> None:
        self.told.append(loads(dumps(document)))

    def begin(self, session: dict[str, Any]) -> None: ...

    def move_off(self) -> None: ...

    def ask_to_end(self) -> None: ...

    def end(self) -> None: ...


class PageClient(Client):
    """A page without a connection. Of the data that are sent to it, it stores only the times."""

    unsent = 0

    def __init__(self, now: Callable[[], float]) -> None:
        connection: Any = SimpleNamespace()
        super().__init__(connection, now)
        self.frames: deque[float] = deque()
        """Times at which the frames were sent that have not arrived yet [s]."""
        self.newest = -math.inf
        """Time at which the newest frame was sent that has arrived, or that the page says to have
        received [s]."""

    def confirm(self, seen: float) -> None:
        super().confirm(seen)
        self.newest = max(self.newest, self.seen)

    def send(self, document: dict[str, Any]) -> None: ...

    def send_rows(self, *arguments: Any) -> None:
        self.frames.append(self._now())
        self._sent[self._now()] = None  # a time that the page may confirm


class InProcess(LiveLink):
    """A live page whose server runs in this process.

    Parameters
    ----------
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
    delay
        Delay of the connection between the live process and the page, in each direction [s].
    armed_behind
        Age of the newest frame that the page had when a START was accepted [s]: the longest of all
        STARTs. It is at most the round trip of the connection.
    """

    def __init__(self, by_page: bool, pointer: bool, now: Callable[[], float]) -> None:
        choices: dict[str, list[Any]] = {"condition": [], "specimen": [], "duration": []}
        with (
            mock.patch.object(live_link, "SharedFile", PrivateFile),
            mock.patch.object(live_link, "ChildProcess", NoProcess),
        ):
            super().__init__("", 0, by_page, pointer, choices)
        self._now = now
        process: Any = self._page
        self._told: deque[dict[str, Any]] = process.told
        self._told.clear()  # the message that starts the process
        welcome = {"may_arm": by_page, "pointer": pointer, "choices": choices}
        self.counts: Any = self._cells.counts
        self.cells = CellWriter(self.counts.obj)
        self._streams: list[Stream | None] = []
        """Stream of each trial so far; None after its end."""
        self._feed = TrialFeed(self.cells, welcome, lambda request: None, lambda recording: {})
        self._server = Server(self._feed, "", {})
        self._server.control = Control(now)
        self._due = self._beat_due = -math.inf
        self._client: PageClient | None = None
        self._sent: deque[tuple[float, PageClient, str | None]] = deque()
        """Messages to the live process that have not arrived: the time when they were sent [s],
        their page, and their text. The text is None if the page closed the connection."""
        self.runs = self.beats = True
        self.delay = self.armed_behind = 0.0
        self.connect()

    def make_operator(self) -> PointerOperator | None:
        return PointerOperator(PagePointer(self._cells, self._now)) if self._has_pointer else None

    def begin(self, settings: TrialSettings, stream: Stream) -> PageRequests:
        super().begin(settings, stream)
        self._told[-1]["stream"] = len(self._streams)
        self._streams.append(stream)
        return PageRequests(self._cells, self.by_page, self._stops, self._now)

    def end_trial(self) -> None:
        self._streams[-1] = None
        super().end_trial()

    def _opened(self, number: int, name: str) -> StreamReader:
        """Return a reader of the stream of a trial, as `StreamReader.open` does."""
        if stream := self._streams[number]:
            return stream.reader()
        raise FileNotFoundError

    def advance(self) -> None:
        """Run the live process and the page until the present time."""
        now = self._now()
        while self.runs and self._told:
            with mock.patch.object(trial_feed.StreamReader, "open", self._opened):
                self._feed.receive(self._told.popleft())
        while self.runs and self._sent and now >= self._sent[0][0] + self.delay:
            self._deliver(*self._sent.popleft()[1:])
        if self.runs and now >= self._due:
            self._due = now + PERIOD
            self._server.fan_out()
        client = self._client
        while client and client.frames and now >= client.frames[0] + self.delay:
            client.newest = client.frames.popleft()
            if self.beats and now >= self._beat_due:
                self._beat_due = now + BEAT
                self.send("beat", seen=client.newest, at=0.0)

    def send(self, kind: str, **fields: Any) -> None:
        """Send a request of the page, if the page is connected."""
        self.send_text(dumps({"type": kind, **fields}))

    def send_text(self, message: str) -> None:
        """Send a message of the page, which may not be a valid request."""
        if self._client:
            self._sent.append((self._now(), self._client, message))

    def _deliver(self, client: PageClient, message: str | None) -> None:
        """Receive a message of a page, as the server does."""
        if client not in self._server._clients:
            return
        starts = self.counts[ARM]
        try:
            if message is None:
                self._drop(client)
            else:
                self._server._receive(client, parse_request(message))
        except BadRequest:
            self._drop(client)
        if self.counts[ARM] != starts:
            self.armed_behind = max(self.armed_behind, self._now() - client.newest)

    def _drop(self, client: PageClient) -> None:
        """Close the connection of a page in the live process."""
        self._server._clients.discard(client)
        if self._server.control.holder is client:
            self._server._lose_control()
        if self._client is client:
            self._client = None

    def connect(self) -> None:
        """Connect a new page in place of the present one."""
        self.disconnect()
        self._client = PageClient(self._now)
        self._server._clients.add(self._client)

    def disconnect(self) -> None:
        """Close the connection of the page. The live process learns it after the delay."""
        if self._client:
            self._sent.append((self._now(), self._client, None))
            self._client = None

    @property
    def seen(self) -> float:
        """Time of the newest data that the page has confirmed, in the shared memory [s]."""
        return memoryview(self.counts.obj).cast("d")[SEEN]

    def arm(self) -> None:
        """Take control, and press UNLOCK and START."""
        for kind in ("control", "unlock", "start"):
            self.send(kind)

    def silence(self) -> None:
        """Send no more heartbeats."""
        self.beats = False

    def slow_down(self) -> None:
        """Delay all further data, so that the page is too far behind although it beats."""
        self.delay = 0.6 * PAGE_AGE

    def flood(self) -> None:
        """Send so many messages at once that the connection is closed after them."""
        for n in range(MOST_FRAMES):
            self.send("beat", seen=0.0, at=n)
        self.disconnect()

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
