"""Messages between the control process and a process that reads its stream, in that process."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from typing import Any

from teleop.json_documents import dumps, loads

FAREWELL = 1.0
"""Longest time for which a process continues after the control process has ended [s]."""
MOST_UNREAD = 1 << 16
"""Largest number of bytes that are read from standard input in one call."""


class ControlPipe:
    """Exchanges JSON documents with the control process, through standard input and output.

    A thread reads standard input, so that only `read_line` waits for a message.
    """

    def __init__(self) -> None:
        self._input, self._output = sys.stdin.fileno(), sys.stdout.fileno()
        self._lines: deque[bytes] = deque()
        self._arrived = threading.Semaphore(0)
        self.ended = 0.0
        """Time at which standard input ended [s]; 0 before it ended."""
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        received = b""
        while part := os.read(self._input, MOST_UNREAD):
            *lines, received = (received + part).split(b"\n")
            self._lines.extend(lines)
            self._arrived.release(max(len(lines), 1))
        self.ended = time.monotonic()
        self._arrived.release()

    def read_line(self) -> dict[str, Any]:
        """Wait for a message of the control process. Raise an EOFError if it has ended."""
        while not self._lines:
            if self.ended and not self._lines:  # the last line arrives before the end
                raise EOFError
            self._arrived.acquire()
        return loads(self._lines.popleft())

    def messages(self) -> Iterator[dict[str, Any]]:
        """Yield the messages that have arrived."""
        while self._lines:
            yield loads(self._lines.popleft())

    def send(self, document: dict[str, Any]) -> None:
        """Send a document, or discard it if the control process does not read or has ended."""
        try:
            os.write(self._output, dumps(document).encode() + b"\n")
        except (BlockingIOError, BrokenPipeError):
            return

    def stop_waiting(self) -> None:
        """From now on, let `send` not wait."""
        if hasattr(os, "set_blocking"):
            os.set_blocking(self._output, False)

    @property
    def is_over(self) -> bool:
        """Whether the control process ended more than `FAREWELL` seconds ago."""
        return self.ended > 0.0 and time.monotonic() - self.ended > FAREWELL
