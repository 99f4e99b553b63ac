"""Limit what one connection to the server of the live page can send, and how many are open."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from websockets.asyncio.server import Server, ServerConnection
from websockets.exceptions import ProtocolError
from websockets.frames import Frame
from websockets.server import ServerProtocol

MOST_FRAMES = 400
"""Largest number of WebSocket frames of any kind that a client may send in a second."""
MOST_GREETING_FRAMES = 8
"""Largest number of WebSocket frames of a connection that has not sent the token yet."""
LONGEST_HEAD = 16_384
"""Largest size of an HTTP request [bytes]. Browsers send about 1 kB."""
MOST_WAITING = 64
"""Largest number of open connections that have not sent the token. If there are more, the oldest is
closed, so that such connections cannot keep a page out."""


class LimitedConnection(ServerConnection):
    """A connection whose data are limited where they arrive, before their content is processed.

    A process that sends data as fast as it can must not occupy the event loop, which also sends the
    heartbeat to the control loop. A frame can have 6 bytes, and 256 kB are received at once.
    Therefore the frames are counted while they are parsed: the first frame above the limit ends the
    parsing.

    `waiting` contains the open connections that have not sent the token, the oldest first.
    """

    def __init__(
        self,
        protocol: ServerProtocol,
        server: Server,
        waiting: dict[LimitedConnection, None],
        **options: Any,
    ) -> None:
        super().__init__(protocol, server, **options)
        self._waiting = waiting
        self._process_frame = protocol.recv_frame
        protocol.recv_frame = self._count_frame  # type: ignore[method-assign]
        self._head = self._frames = self._second = 0
        self._most = MOST_GREETING_FRAMES
        self._abort: Callable[[], None] = lambda: None

    def admit(self) -> None:
        """Give this connection the limits of a client, because it has sent the token."""
        self._waiting.pop(self, None)
        self._most = MOST_FRAMES

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Count the connection. If too many are open, close the oldest that has sent no token."""
        super().connection_made(transport)
        self._abort = self.transport.abort
        self._waiting[self] = None
        if len(self._waiting) > MOST_WAITING:
            oldest = next(iter(self._waiting))
            del self._waiting[oldest]
            oldest._abort()

    def send_completely(self) -> None:
        """Send the whole HTTP response, which can be a large file, before the connection is closed.

        The library websockets aborts a connection whose response takes longer than the time limit
        of closing, and discards the rest of the response.
        """
        self.transport.abort = self.transport.close  # type: ignore[method-assign]

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._waiting.pop(self, None)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Process data, unless the HTTP request is too large."""
        if self.request is None:
            self._head += len(data)
            if self._head > LONGEST_HEAD:
                self.transport.abort()
                return
        super().data_received(data)

    def _count_frame(self, frame: Frame) -> None:
        second = int(time.monotonic())
        if second != self._second and self not in self._waiting:
            self._second, self._frames = second, 0
        self._frames += 1
        if self._frames > self._most:
            self.transport.abort()
            raise ProtocolError("too many frames")
        self._process_frame(frame)
