"""Pseudo-terminal that a host uses as a serial port."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

CHUNK = 1 << 16
"""Largest number of bytes that one call of `read` returns."""


class PseudoTerminal:
    """A pseudo-terminal with a fixed path, which a host opens like a serial port.

    Parameters
    ----------
    path
        Path of the port, a symbolic link.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ends: tuple[int, ...] = ()

    def open(self) -> None:
        """Create the port, and the link to it at `path`.

        Raises
        ------
        NotImplementedError
            The system does not support pseudo-terminals.
        """
        try:
            import pty
            import tty
        except ImportError as error:
            raise NotImplementedError("there are no pseudo-terminals on this system") from error
        device, host = pty.openpty()
        tty.setraw(host)
        os.set_blocking(device, False)
        self._ends = device, host
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(host))

    def filenos(self) -> list[int]:
        """Return the file descriptor of the device's end, if the port is open."""
        return list(self._ends[:1])

    def read(self) -> bytes:
        """Return the bytes that the host has sent, without waiting."""
        with contextlib.suppress(BlockingIOError, OSError, IndexError):
            return os.read(self._ends[0], CHUNK)
        return b""

    def write(self, data: bytes) -> None:
        """Send bytes to the host. Bytes that the host does not read in time are lost."""
        if data:
            with contextlib.suppress(BlockingIOError, OSError, IndexError):
                os.write(self._ends[0], data)

    def close(self) -> None:
        """Remove the port and the link to it."""
        for end in self._ends:
            os.close(end)
        self._ends = ()
        self.path.unlink(missing_ok=True)
