"""Read a file that may be damaged, with limits for the size of a read and for the used memory."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

from teleop.errors import InputError

LARGEST_RECORD = 128 << 20
"""Size of the largest record that is read [bytes]."""


def machine_memory() -> int:
    """Return the memory size of this machine [bytes]; a default value if the size is unknown."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 8 << 30


LARGEST_TICKS = machine_memory() // 4
"""Largest total size of ticks that are stored in memory [bytes]. The columns that are computed from
the ticks need the same amount of memory again."""


def check_memory(path: Path | str, size: int) -> None:
    """Check that the ticks of a recording fit into the memory of this machine.

    Parameters
    ----------
    path
        The recording, for the error message.
    size
        Total size of the ticks [bytes].

    Raises
    ------
    InputError
        The size is larger than `LARGEST_TICKS`.
    """
    if size > LARGEST_TICKS:
        raise InputError(
            f"{path}: too large for this machine's memory: more than {LARGEST_TICKS >> 20} MiB "
            "of ticks"
        )


class BoundedFile:
    """A file from which one call of `read` returns at most `LARGEST_RECORD` bytes.

    A file consists of records that state their own length. If a record is damaged, the stated
    length can be much too large, and a reader would request too many bytes. Bytes that are added to
    the file after this object is created are not read.

    Parameters
    ----------
    file
        An open regular file (not a pipe or device), from which nothing has been read yet.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.left = os.fstat(file.fileno()).st_size
        """Number of bytes that have not been read yet."""

    def read(self, count: int) -> bytes:
        """Return the next `count` bytes of the file, but at most `LARGEST_RECORD` bytes.

        If the file contains fewer bytes after the present position, all of them are returned.
        """
        data = self._file.read(min(count, self.left, LARGEST_RECORD))
        self.left -= len(data)
        return data
