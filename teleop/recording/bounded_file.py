"""Read a file that may be damaged. The bytes per read and the memory for ticks are limited."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

from teleop.errors import InputError

LARGEST_RECORD = 128 << 20
"""Size of the largest record that is read [bytes]."""


def machine_memory() -> int:
    """Return the memory of this machine [bytes], or 8 GiB if the system does not report it."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 8 << 30


LARGEST_TICKS = machine_memory() // 4
"""Largest total size of ticks that are stored in memory [bytes]. The columns that are computed from
the ticks need the same amount of memory again."""


def check_memory(path: Path | str, size: int) -> None:
    """Raise InputError if `size`, the total size of the ticks [bytes], exceeds `LARGEST_TICKS`."""
    if size > LARGEST_TICKS:
        raise InputError(
            f"{path}: too large for this machine's memory: more than {LARGEST_TICKS >> 20} MiB "
            "of ticks"
        )


class BoundedFile:
    """A file from which one read returns at most `LARGEST_RECORD` bytes.

    A damaged record can state a wrong length, so that a reader requests too many bytes. Bytes that
    are added to the file later are not read.

    Parameters
    ----------
    file
        A regular file, from which nothing has been read yet.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.left = os.fstat(file.fileno()).st_size
        """Number of bytes that have not been read yet."""

    def read(self, count: int) -> bytes:
        """Return the next `count` bytes, but at most `LARGEST_RECORD` bytes.

        At the end of the file, fewer bytes are returned.
        """
        data = self._file.read(min(count, self.left, LARGEST_RECORD))
        self.left -= len(data)
        return data
