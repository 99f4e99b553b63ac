"""Write to a terminal from a separate thread.

While the terminal is stopped (Ctrl-S), a write blocks. Only the separate thread then has to wait.
"""

from __future__ import annotations

import contextlib
import os
import threading

TIMEOUT = 0.5
"""Longest time for which `close` waits for the terminal [s]."""


class Terminal:
    """Writes to a terminal without blocking the caller.

    While a terminal is stopped (Ctrl-S), or while its output is not read, a write to the terminal
    blocks. A separate thread therefore writes the text. The file descriptor itself remains in
    blocking mode, because a change of its mode would also apply to the shell.

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
        """Write a text that is needed only until the next call of `draw` or `write`.

        If the text has not been written before this next call, it is discarded.
        """
        with self._changed:
            self._line = encoded(text)
            self._wake()

    def write(self, text: str) -> None:
        """Write a text that is never discarded.

        If the last text of `draw` has not been written yet, the text of `draw` is discarded.
        """
        with self._changed:
            self._kept += encoded(text)
            self._line = b""
            self._wake()

    def close(self) -> None:
        """Wait until all text is written, for at most `TIMEOUT`."""
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
    """Return the text in UTF-8. Characters that cannot be encoded become backslash escapes."""
    return text.encode(errors="backslashreplace")
