"""Output to a terminal from a separate thread, so that a stopped terminal blocks nothing else."""

from __future__ import annotations

import contextlib
import os
import threading

TIMEOUT = 0.5
"""Longest time for which `close` waits for the terminal [s]."""


class Terminal:
    """Writes to a terminal without ever blocking the caller.

    A terminal blocks a program that writes to it while it is stopped (Ctrl-S) or while its output
    is not read. The descriptor is shared with the shell; it must not be made non-blocking.

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
        """Write text that replaces the text of the last call if that is not written yet."""
        with self._changed:
            self._line = encoded(text)
            self._wake()

    def write(self, text: str) -> None:
        """Write text that is never discarded; unwritten text of an earlier `draw` is discarded."""
        with self._changed:
            self._kept += encoded(text)
            self._line = b""
            self._wake()

    def close(self) -> None:
        """Wait until all text is written, at most `TIMEOUT`."""
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


def encoded(text: str) -> bytes:
    """Return text in UTF-8, with escapes for characters that cannot be encoded."""
    return text.encode(errors="backslashreplace")
