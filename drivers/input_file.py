"""Read only regular files. FIFOs and device files are rejected: reading them may never end."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

LARGEST = 16 << 20
"""Largest size of a file that `read_input` reads by default [bytes]."""
KINDS = (
    (stat.S_ISDIR, "folder"),
    (stat.S_ISFIFO, "FIFO"),
    (stat.S_ISSOCK, "socket"),
    (stat.S_ISCHR, "device"),
    (stat.S_ISBLK, "device"),
)
"""Pairs (function that tests a file mode, name), for the kinds of files that are rejected."""


def open_input(path: Path) -> BinaryIO:
    """Open a regular file for reading in binary mode.

    FIFOs and device files are rejected at once, without waiting for their data.
    """
    check_regular(path.stat().st_mode)  # before opening, because opening a device can have effects
    file: BinaryIO = open(path, "rb", opener=without_waiting)  # noqa: SIM115
    try:
        check_regular(os.fstat(file.fileno()).st_mode)
    except OSError:
        file.close()
        raise
    return file


def read_input(path: Path, largest: int = LARGEST) -> bytes:
    """Return the content of a regular file."""
    with open_input(path) as file:
        content = file.read(largest + 1)
    if len(content) > largest:
        raise OSError(errno.EFBIG, f"expected a file of at most {largest >> 20} MiB")
    return content


def check_regular(mode: int) -> None:
    """Raise OSError if a file mode (`st_mode`) is not the mode of a regular file."""
    if not stat.S_ISREG(mode):
        kind = next((kind for is_one, kind in KINDS if is_one(mode)), "special file")
        raise OSError(errno.EINVAL, f"expected a file, this is a {kind}")


def without_waiting(path: str, flags: int) -> int:
    """Open a file without waiting, and return the file descriptor.

    Even a FIFO without a writer is opened at once. This function is used as the argument `opener`
    of the built-in function `open`.
    """
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
