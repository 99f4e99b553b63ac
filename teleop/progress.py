"""The progress line, drawn by a process of its own so that no terminal ever holds the loop."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys


class ProgressLine:
    """One line on standard error that is drawn over and over; nothing where that is no terminal."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        if sys.stderr.isatty() and hasattr(os, "set_blocking"):
            self._process = subprocess.Popen(
                [sys.executable, "-S", "-P", __file__], stdin=subprocess.PIPE, bufsize=0
            )
            assert self._process.stdin
            self._pipe = self._process.stdin.fileno()
            os.set_blocking(self._pipe, False)

    @property
    def shown(self) -> bool:
        """Whether anyone sees the line."""
        return self._process is not None

    def show(self, text: str) -> None:
        """Draw this text; dropped if the terminal has not kept up."""
        if self._process:
            with contextlib.suppress(BlockingIOError, BrokenPipeError):
                os.write(self._pipe, text.encode() + b"\n")

    def close(self) -> None:
        """Wipe the line."""
        if self._process and self._process.stdin:
            self._process.stdin.close()
            self._process.wait()


def draw() -> None:
    """Draw each line of standard input over the one before."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for line in sys.stdin:
        width = os.get_terminal_size(sys.stderr.fileno()).columns or 80
        sys.stderr.write("\r" + line.rstrip("\n")[: width - 1] + "\x1b[K")
        sys.stderr.flush()
    sys.stderr.write("\r\x1b[K")


if __name__ == "__main__":
    draw()
