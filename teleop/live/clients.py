"""Send data to the open live pages (the clients), and limit the amount of data and requests."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from websockets.asyncio.server import ServerConnection, broadcast

from teleop.json_documents import dumps
from teleop.live.history import HEAD, History

MOST_CLIENTS = 8
"""Largest number of connected clients."""
MOST_UNSENT = 64_000
"""Largest number of unsent bytes to a client. If there are more, no further frames are sent."""
MOST_UNSENT_TEXT = 4 * MOST_UNSENT
"""Largest number of unsent bytes to a client. If there are more, the connection is aborted."""
MOST_SENT = 1024
"""Number of frames whose times are stored for each client. They are sent in more than 15 s."""
ALIVE = 2.0
"""Longest time between two heartbeats of the live page that has control [s]. A heartbeat is a
message that a page sends at regular times."""
UNLOCKED = 2.0
"""Time for which the request `start` is accepted after a person pressed the button Unlock [s]."""


class Client:
    """A live page in a browser that is connected to the server."""

    def __init__(
        self, connection: ServerConnection, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.connection = connection
        self.view = "main"
        self.is_new = True
        """Whether the messages for new clients have not been sent yet."""
        self._now = now
        self._epoch = -1
        self._next = 0
        self.seen = -math.inf
        """Time at which the newest frame was sent that the page has confirmed [s]."""
        self._sent: dict[float, None] = {}
        """Times of the newest frames that were sent, the oldest first. The values are not used."""

    @property
    def unsent(self) -> int:
        """Number of bytes for this client that still wait in the send buffer of this process."""
        return self.connection.transport.get_write_buffer_size()

    def confirm(self, seen: float) -> None:
        """Store that the page has received the frame that was sent at the time `seen` [s].

        The page returns the time in the newest frame that it has received. This is a time of the
        clock of this process, and the clocks need not agree. A time at which no frame was sent to
        this page is ignored, because it says nothing about the data that the page has.
        """
        if seen in self._sent:
            self.seen = max(self.seen, seen)

    @property
    def age(self) -> float:
        """Age of the newest frame that the page has confirmed [s].

        It is at least the round trip of the connection, from this process to the page and back.
        """
        return self._now() - self.seen

    def send(self, document: dict[str, Any]) -> None:
        """Send a message, or abort the connection if too many bytes are unsent."""
        if self.unsent > MOST_UNSENT_TEXT:
            self.abort()
        else:
            broadcast([self.connection], dumps(document))

    def send_rows(
        self, history: History, frames: dict[tuple[int, bool], tuple[bytes, int]]
    ) -> None:
        """Send the rows that the client has not received yet, unless too many bytes are unsent.

        `frames` contains the frames of this period of the server, by the index of their first row
        and whether they replace all rows of the page. Clients that need the same rows share one
        frame. If there are no new rows, the frame contains only the time, which the page returns
        (see `confirm`).
        """
        clear = self._epoch != history.epoch
        first = history.start if clear else self._next
        if self.unsent > MOST_UNSENT:
            return
        if (first, clear) not in frames:
            frames[first, clear] = history.frame(first, clear)
        frame, self._next = frames[first, clear]
        self._epoch = history.epoch
        self._sent[HEAD.unpack_from(frame)[-1]] = None
        if len(self._sent) > MOST_SENT:
            del self._sent[next(iter(self._sent))]
        broadcast([self.connection], frame)

    def abort(self) -> None:
        """Close the connection immediately, and discard unsent data."""
        self.connection.transport.abort()


class Control:
    """Stores which client has control: only this client may send requests such as `start`."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.holder: Client | None = None
        self._now = now
        self._beat = self._unlocked = -math.inf

    def ask(self, client: Client) -> bool:
        """Give control to a client, unless another has it. Return whether it now has control."""
        if self.holder is None:
            self.holder = client
            self.lock()
            self.beat(client)
        return self.holder is client

    def release(self, client: Client) -> bool:
        """End the control by a client. Return False if it did not have control."""
        if self.holder is not client:
            return False
        self.holder = None
        self.lock()
        return True

    def beat(self, client: Client) -> bool:
        """Store the time of a heartbeat of a client. Return whether it has control."""
        if self.holder is client:
            self._beat = self._now()
        return self.holder is client

    @property
    def is_silent(self) -> bool:
        """Whether the last heartbeat of the client in control is more than `ALIVE` seconds ago."""
        return self.holder is not None and self._now() - self._beat > ALIVE

    @property
    def unlocked(self) -> bool:
        """Whether the request `start` of the live page, which arms the drives, is accepted now."""
        return self._now() - self._unlocked <= UNLOCKED

    def unlock(self) -> None:
        """Accept the request `start`, which arms the drives, for the next `UNLOCKED` seconds."""
        self._unlocked = self._now()

    def lock(self) -> None:
        """Refuse the request `start`, which arms the drives, until the next call of `unlock`."""
        self._unlocked = -math.inf

    def of(self, client: Client) -> str:
        """Return who has control, for a message to a client: `you`, `other` or `none`."""
        if self.holder is None:
            return "none"
        return "you" if self.holder is client else "other"
