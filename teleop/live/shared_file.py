"""A file in memory, through which two processes exchange data.

The control process runs the control loop. The live process serves the live page, a web page that
shows a running trial.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import tempfile
from pathlib import Path

MEMORY = Path("/dev/shm")
"""Folder on Linux whose files are in memory."""


class SharedFile:
    """A memory-mapped file that the control process creates and the live process opens.

    The control process runs the control loop, and the live process serves the live page. As soon as
    the live process has opened the file, the control process removes the name of the file from the
    file system. Both processes can use the mapped memory until they end.

    Attributes
    ----------
    path
        Path of the file.
    buffer
        The mapped bytes.
    """

    def __init__(self, path: Path, buffer: mmap.mmap) -> None:
        self.path = path
        self.buffer = buffer

    @classmethod
    def create(cls, size: int) -> SharedFile:
        """Create a new file of zeros, map it into memory, and return it.

        Only the user who runs this program can open the file.

        Parameters
        ----------
        size
            Size of the file [bytes].

        Raises
        ------
        OSError
            The file cannot be created.
        """
        folder = MEMORY if os.access(MEMORY, os.W_OK) else None
        number, name = tempfile.mkstemp(prefix="teleop-live-", dir=folder)
        try:
            with os.fdopen(number, "r+b") as file:
                file.write(bytes(size))  # if the memory is full, this fails here, not in the loop
                file.flush()
                return cls(Path(name), mmap.mmap(file.fileno(), size))
        except BaseException:
            Path(name).unlink()
            raise

    @classmethod
    def open(cls, path: Path, writable: bool) -> SharedFile:
        """Map an existing file into memory, and return it.

        Parameters
        ----------
        path
            Path of the file.
        writable
            Whether the mapped bytes can be changed; otherwise they can only be read.

        Raises
        ------
        OSError
            The file cannot be opened.
        """
        with path.open("r+b" if writable else "rb") as file:
            access = mmap.ACCESS_WRITE if writable else mmap.ACCESS_READ
            return cls(path, mmap.mmap(file.fileno(), 0, access=access))

    def remove(self) -> None:
        """Remove the name of the file from the file system, if it still exists.

        The mapped memory remains usable in the processes that have opened the file.
        """
        with contextlib.suppress(OSError):
            self.path.unlink()
