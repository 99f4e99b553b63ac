"""Files that are read: regular ones, since a FIFO or a device may never answer or never end."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

LARGEST = 16 << 20
"""Largest file that is read as a whole [bytes]: settings, zeros, descriptions of frames."""
KINDS = (
    (stat.S_ISDIR, "folder"),
    (stat.S_ISFIFO, "FIFO"),
    (stat.S_ISSOCK, "socket"),
    (stat.S_ISCHR, "device"),
    (stat.S_ISBLK, "device"),
)


def open_input(path: Path) -> BinaryIO:
    """Open a regular file, and wait for nothing.

    Raises
    ------
    OSError
        It cannot be opened, or is not a regular file.
    """
    check_regular(path.stat().st_mode)  # before it is opened: that alone can act on a device
    file: BinaryIO = open(path, "rb", opener=without_waiting)  # noqa: SIM115
    try:
        check_regular(os.fstat(file.fileno()).st_mode)
    except OSError:
        file.close()
        raise
    return file


def read_input(path: Path, largest: int = LARGEST) -> bytes:
    """All of a regular file.

    Raises
    ------
    OSError
        It cannot be read, is not a regular file, or is larger than `largest` [bytes].
    """
    with open_input(path) as file:
        content = file.read(largest + 1)
    if len(content) > largest:
        raise OSError(errno.EFBIG, f"expected a file of at most {largest >> 20} MiB")
    return content


def check_regular(mode: int) -> None:
    """Raise OSError unless the mode of a file is that of a regular one."""
    if not stat.S_ISREG(mode):
        kind = next((kind for is_one, kind in KINDS if is_one(mode)), "special file")
        raise OSError(errno.EINVAL, f"expected a file, this is a {kind}")


def without_waiting(path: str, flags: int) -> int:
    """Open as `open` does; a FIFO without a writer does not hold it."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
