"""A file in memory, through which two processes exchange data."""

from __future__ import annotations

import contextlib
import mmap
import os
import tempfile
from pathlib import Path

MEMORY = Path("/dev/shm")
"""Folder on Linux whose files are in memory."""


class SharedFile:
    """A memory-mapped file that the control process creates and another process opens.

    As soon as the other process has opened the file, the control process removes its name from the
    file system. Both can use the mapped memory until they end.
    """

    def __init__(self, path: Path, buffer: mmap.mmap) -> None:
        self.path = path
        self.buffer = buffer

    @classmethod
    def create(cls, size: int) -> SharedFile:
        """Create a new file of zeros, which only this user can open, and map it into memory."""
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
        """Map an existing file into memory."""
        with path.open("r+b" if writable else "rb") as file:
            access = mmap.ACCESS_WRITE if writable else mmap.ACCESS_READ
            return cls(path, mmap.mmap(file.fileno(), 0, access=access))

    def remove(self) -> None:
        """Remove the name of the file, if it still exists. The mapped memory remains usable."""
        with contextlib.suppress(OSError):
            self.path.unlink()
