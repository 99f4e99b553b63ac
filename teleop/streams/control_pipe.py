"""Messages between the control process and a process that reads its stream, in that process."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import deque
from typing import Any, Protocol

from teleop.json_documents import dumps, loads

FAREWELL = 1.0
"""Longest time for which a process continues after the control process has ended [s]."""
MOST_UNREAD = 1 << 16
"""Largest number of bytes that are read from standard input in one call."""


class Receiver(Protocol):
    """Receives the messages of the control process about its trials."""

    def receive(self, document: dict[str, Any]) -> None:
        """Process a message of the control process."""

    def leave(self) -> None:
        """Process the event that the control process has ended."""


class ControlPipe:
    """Exchanges JSON documents with the control process, through standard input and output.

    A thread reads standard input, so that only `read_line` waits for a message.
    """

    def __init__(self) -> None:
        self._input, self._output = sys.stdin.fileno(), sys.stdout.fileno()
        self._lines: deque[bytes | None] = deque()
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
        self._lines.append(None)
        self._arrived.release()

    def read_line(self) -> dict[str, Any]:
        """Wait for a message of the control process. Raise an EOFError if it has ended."""
        while not self._lines:
            self._arrived.acquire()
        line = self._lines.popleft()
        if line is None:
            raise EOFError
        return loads(line)

    def receive_into(self, receiver: Receiver) -> None:
        """Pass arrived messages, and the end of the control process, to `receiver`."""
        while self._lines:
            line = self._lines.popleft()
            if line is None:
                self.ended = time.monotonic()
                receiver.leave()
                return
            receiver.receive(loads(line))

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
