"""A file in memory, through which processes exchange data."""

from __future__ import annotations

import contextlib
import mmap
import os
import tempfile
from pathlib import Path

MEMORY = Path("/dev/shm")
"""Folder on Linux whose files are in memory."""


class SharedFile:
    """A memory-mapped file that one process creates and other processes open.

    After its name was removed from the file system, the processes that have opened the file can
    use the mapped memory until they end.
    """

    def __init__(self, path: Path, buffer: mmap.mmap) -> None:
        self.path = path
        self.buffer = buffer

    @classmethod
    def create(cls, size: int) -> SharedFile:
        """Create a new file of zeros, which only this user can open, and map it into memory.

        It is a file of the disk if the memory file system is missing or full.
        """
        if os.access(MEMORY, os.W_OK):
            with contextlib.suppress(OSError):
                return cls._created(size, MEMORY)
        return cls._created(size, None)

    @classmethod
    def _created(cls, size: int, folder: Path | None) -> SharedFile:
        number, name = tempfile.mkstemp(prefix="teleop-", dir=folder)
        try:
            with os.fdopen(number, "r+b") as file:
                for start in range(0, size, 1 << 20):
                    # if the memory is full, this fails here, not in the loop
                    file.write(bytes(min(size - start, 1 << 20)))
                file.flush()
                return cls(Path(name), mmap.mmap(file.fileno(), size))
        except BaseException:
            Path(name).unlink()
            raise

    @classmethod
    def open(cls, path: Path, writable: bool = False) -> SharedFile:
        """Map an existing file into memory."""
        with path.open("r+b" if writable else "rb") as file:
            access = mmap.ACCESS_WRITE if writable else mmap.ACCESS_READ
            return cls(path, mmap.mmap(file.fileno(), 0, access=access))

    def remove(self) -> None:
        """Remove the name of the file, if it still exists. The mapped memory remains usable."""
        with contextlib.suppress(OSError):
            self.path.unlink()
