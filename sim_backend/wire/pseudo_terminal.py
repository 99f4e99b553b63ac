"""A pseudo-terminal that stands for a serial port."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

CHUNK = 1 << 16
"""Most bytes that are read at once."""


class PseudoTerminal:
    """A pseudo-terminal under a path that stays the same, which a host opens like a port.

    Parameters
    ----------
    path
        Where the port stands, a symbolic link.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ends: tuple[int, ...] = ()

    def open(self) -> None:
        """Plug it in.

        Raises
        ------
        NotImplementedError
            The system has no pseudo-terminals.
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
        """The device's end, while it is plugged in."""
        return list(self._ends[:1])

    def read(self) -> bytes:
        """What the host has sent."""
        with contextlib.suppress(BlockingIOError, OSError, IndexError):
            return os.read(self._ends[0], CHUNK)
        return b""

    def write(self, data: bytes) -> None:
        """Send to the host; what nobody takes is lost, as on a wire."""
        if data:
            with contextlib.suppress(BlockingIOError, OSError, IndexError):
                os.write(self._ends[0], data)

    def close(self) -> None:
        """Unplug it."""
        for end in self._ends:
            os.close(end)
        self._ends = ()
        self.path.unlink(missing_ok=True)
