"""Output to a terminal by a thread of its own, which a stopped terminal may block without harm."""

from __future__ import annotations

import contextlib
import os
import threading

PATIENCE = 0.5
"""Longest time for which `close` waits for the terminal [s]."""


class Terminal:
    """Writes to a terminal without ever blocking the caller.

    A terminal blocks its writer while it is stopped (Ctrl-S) or while nobody reads it. The
    descriptor itself cannot be made non-blocking, because the shell shares it.

    Parameters
    ----------
    descriptor
        File descriptor to write to.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._changed = threading.Condition()
        self._kept = b""
        self._line = b""
        self._closed = False
        self._thread = threading.Thread(target=self._write_all, daemon=True)

    def draw(self, text: str) -> None:
        """Write text that replaces the last drawing if that has not been written yet."""
        with self._changed:
            self._line = encoded(text)
            self._wake()

    def write(self, text: str) -> None:
        """Write text that is not to be lost, after which nothing drawn before is written."""
        with self._changed:
            self._kept += encoded(text)
            self._line = b""
            self._wake()

    def close(self) -> None:
        """Wait until all is written, but no longer than `PATIENCE`."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(PATIENCE)

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


def encoded(text: str) -> bytes:
    """Text as a terminal of any encoding shows it: UTF-8."""
    return text.encode(errors="backslashreplace")
