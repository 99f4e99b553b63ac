"""Write to a terminal from a separate thread, so that the caller never waits for it."""

from __future__ import annotations

import contextlib
import os
import threading

from teleop.files import encoded

TIMEOUT = 0.5
"""Longest time for which `close` waits for the terminal [s]."""


class Terminal:
    """Writes to a file descriptor without delay of the caller.

    While a terminal is stopped (Ctrl-S), or while its output is not read, a write to it waits. A
    separate thread therefore writes the text. The file descriptor is not changed to non-blocking
    mode, because the shell uses the same terminal, and its mode would change, too.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._changed = threading.Condition()
        self._kept = b""
        self._line = b""
        self._closed = False
        self._thread = threading.Thread(target=self._write_all, daemon=True)

    def draw(self, text: str) -> None:
        """Write a text that the next text replaces, such as a progress line.

        If it has not been written before the next call of `draw` or `write`, it is discarded.
        """
        with self._changed:
            self._line = encoded(text)
            self._wake()

    def write(self, text: str) -> None:
        """Write a text that remains, such as a message. A waiting text of `draw` is discarded."""
        with self._changed:
            self._kept += encoded(text)
            self._line = b""
            self._wake()

    def close(self) -> None:
        """Wait until all text is written, for at most `TIMEOUT` seconds."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(TIMEOUT)

    def _wake(self) -> None:
        if not self._thread.ident:
            self._thread.start()
        self._changed.notify()

    def _write_all(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: self._kept or self._line or self._closed)
                    rest = self._kept + self._line
                    self._kept = self._line = b""
                if not rest:
                    return
                while rest:
                    rest = rest[os.write(self._descriptor, rest) :]
