"""Read lines that a person types while a loop is running, without blocking the loop."""

from __future__ import annotations

import os
import select

LARGEST = 4096
"""Largest number of bytes that are read in one call."""


class TypedLines:
    """Reads the complete lines that a person types.

    While the process is in the background, no lines are read.

    Parameters
    ----------
    descriptor
        File descriptor of the input.
    """

    def __init__(self, descriptor: int = 0) -> None:
        self._descriptor = descriptor
        self._ended = False
        self._rest = b""

    def read(self) -> list[str]:
        """Return the lines that were typed since the last call; empty after the end of input."""
        if self._ended:
            return []
        try:
            if not select.select((self._descriptor,), (), (), 0.0)[0] or self._in_background():
                return []
            data = os.read(self._descriptor, LARGEST)
        except (OSError, ValueError):  # closed, or a terminal that was closed
            data = b""
        self._ended = not data
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [line.decode(errors="replace") for line in lines]

    def _in_background(self) -> bool:
        """Return whether the input is the terminal that controls this process in the background."""
        try:
            return os.tcgetpgrp(self._descriptor) != os.getpgrp()
        except OSError:  # not a terminal, or a terminal that does not control this process
            return False
