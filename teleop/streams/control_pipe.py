"""The side of a reader process: messages of the control process, and the loop of a reader."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from teleop.errors import InputError
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


class Reader(Receiver, Protocol):
    """Reads a stream in a process of its own."""

    def advance(self) -> None:
        """Read what is new in the stream."""

    def finish(self) -> dict[str, Any]:
        """Read the rest of the stream, and return the last message to the control process."""


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


def run_reader(
    make: Callable[[dict[str, Any], Callable[[dict[str, Any]], None]], Reader], period: float
) -> None:
    """Run the reader of a process until the control process closes the pipe, or has ended.

    `make` creates the reader from the description of the session and the function that sends a
    message to the control process. `period` is the time between two reads of the stream [s]; it is
    longer after a long read, so that a tenth of the processor remains for other programs.
    """
    pipe = ControlPipe()
    try:
        session = pipe.read_line()
        reader = make(session, pipe.send)
    except EOFError:  # the control process has ended before
        return
    except InputError as problem:
        pipe.send({"problem": str(problem)})
        return
    pipe.send({"problem": ""})
    while not pipe.ended:
        start = time.monotonic()
        pipe.receive_into(reader)
        reader.advance()
        time.sleep(max(period, (time.monotonic() - start) / 9.0))
    pipe.send(reader.finish())
