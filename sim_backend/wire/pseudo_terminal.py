"""Pseudo-terminal that the host of an emulated device uses as a serial port."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from drivers.posix import needs_posix, posix_module

CHUNK = 1 << 16
"""Largest number of bytes that one call of `read` returns."""


class PseudoTerminal:
    """A pseudo-terminal that connects an emulated device to a host (a control program).

    The host opens one end of the pseudo-terminal like a serial port. The emulated device uses the
    other end with the methods of this class.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ends: tuple[int, ...] = ()

    def open(self) -> None:
        """Create the pseudo-terminal, and a symbolic link to it at the path `self.path`."""
        pty, tty = posix_module("pty"), posix_module("tty")
        if pty is None or tty is None:
            raise NotImplementedError(needs_posix("a pseudo-terminal"))
        device, host = pty.openpty()
        tty.setraw(host)
        os.set_blocking(device, False)
        self._ends = device, host
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(host))

    def filenos(self) -> list[int]:
        """Return a list with the file descriptor of the emulated device's end; empty if closed."""
        return list(self._ends[:1])

    def read(self) -> bytes:
        """Return the bytes that the host has sent since the last call. Do not wait for bytes."""
        with contextlib.suppress(BlockingIOError, OSError, IndexError):
            return os.read(self._ends[0], CHUNK)
        return b""

    def write(self, data: bytes) -> None:
        """Send bytes to the host. If the buffer of the pseudo-terminal is full, bytes are lost."""
        if data:
            with contextlib.suppress(BlockingIOError, OSError, IndexError):
                os.write(self._ends[0], data)

    def close(self) -> None:
        """Remove the pseudo-terminal and the symbolic link to it."""
        for end in self._ends:
            os.close(end)
        self._ends = ()
        self.path.unlink(missing_ok=True)
