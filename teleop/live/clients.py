"""One client of the live page: its connection, its limits, and what it has received."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from websockets.asyncio.server import ServerConnection, broadcast

from teleop.json_documents import dumps
from teleop.live.history import History

MOST_CLIENTS = 8
"""Largest number of clients at a time."""
MOST_REQUESTS = 400
"""Largest number of messages of a client in a second."""
MOST_UNSENT = 64_000
"""Number of unsent bytes of a client above which it receives no further frames."""
MOST_UNSENT_TEXT = 4 * MOST_UNSENT
"""Number of unsent bytes of a client above which its connection is aborted."""
ALIVE = 2.0
"""Longest time between two heartbeats of a page in control [s]."""


class Client:
    """A page that is connected.

    Parameters
    ----------
    connection
        The WebSocket connection.
    now
        Returns the present time [s].

    Attributes
    ----------
    view
        View that the page shows: main or operator.
    is_new
        Whether the client has not received the messages for new clients yet.
    """

    def __init__(
        self, connection: ServerConnection, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.connection = connection
        self.view = "main"
        self.is_new = True
        self._now = now
        self._epoch = -1
        self._next = 0
        self._second = 0
        self._requests = 0

    @property
    def unsent(self) -> int:
        """Number of bytes that the system has not accepted yet."""
        return self.connection.transport.get_write_buffer_size()

    def is_flooding(self) -> bool:
        """Count a message, and return whether there were too many in this second."""
        second = int(self._now())
        if second != self._second:
            self._second, self._requests = second, 0
        self._requests += 1
        return self._requests > MOST_REQUESTS

    def send(self, document: dict[str, Any]) -> None:
        """Send a message, or abort the connection of a client that does not read."""
        if self.unsent > MOST_UNSENT_TEXT:
            self.abort()
        else:
            broadcast([self.connection], dumps(document))

    def send_rows(
        self, history: History, frames: dict[tuple[int, bool], tuple[bytes, int]]
    ) -> None:
        """Send the next rows of the history, unless too much is unsent.

        Parameters
        ----------
        history
            The rows.
        frames
            Frames that other clients have received at this time, by their first row.
        """
        clear = self._epoch != history.epoch
        first = history.start if clear else self._next
        if self.unsent > MOST_UNSENT or (first == history.end and not clear):
            return
        if (first, clear) not in frames:
            frames[first, clear] = history.frame(first, clear)
        frame, self._next = frames[first, clear]
        self._epoch = history.epoch
        broadcast([self.connection], frame)

    def abort(self) -> None:
        """Close the connection at once."""
        self.connection.transport.abort()
