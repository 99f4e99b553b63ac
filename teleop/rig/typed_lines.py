"""Read lines that a person types while a loop is running, without blocking the loop."""

from __future__ import annotations

import os
import select

LARGEST = 4096
"""Largest number of bytes that are read in one call."""


class TypedLines:
    """Reader of the lines that a person types, which never waits for input.

    A line is read when it is complete. While the process runs in the background of its terminal, no
    lines are read.
    """

    def __init__(self, descriptor: int = 0) -> None:
        self._descriptor = descriptor
        self._ended = False
        self._rest = b""

    def read(self) -> list[str]:
        """Return the complete lines that were typed since the last call.

        The list is empty if there is no new line, also after the end of the input.
        """
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
        """Return whether the input is a terminal in which this process runs in the background.

        The operating system suspends a process in the background that reads from its terminal.
        """
        try:
            return os.tcgetpgrp(self._descriptor) != os.getpgrp()
        except OSError:  # not a terminal, or a terminal that does not control this process
            return False
