"""Read and append to a file of JSON documents, one per line.

Each line is written to the disk before the program continues. If the program is killed, only the
last line can be incomplete. An incomplete line is not read, and is removed when the next line is
appended. Reading does not change the file, because another program may be writing to it.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

from drivers.input_file import open_input
from drivers.posix import posix_module
from teleop.errors import InputError, reason
from teleop.files import unreadable, unwritable
from teleop.json_documents import dumps, loads

LOCK = ".lock"
"""Name of the lock file of a folder. This file is locked while a program works in the folder."""


class JsonLines:
    """A file with one JSON document per line."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def append(self, documents: Iterable[dict[str, Any]]) -> list[int]:
        """Append documents, wait until they are on the disk, and return their positions [bytes]."""
        positions = []
        try:
            with self.path.open("a+b") as file:
                remove_incomplete_line(file)
                for document in documents:
                    positions.append(file.tell())
                    file.write(dumps(document).encode() + b"\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise unwritable(self.path, error) from error
        return positions

    def read(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield position [bytes] and document of each line that is complete."""
        if not self.path.exists():
            return
        try:
            opened = open_input(self.path)
        except OSError as error:
            raise unreadable(self.path, error) from error
        with opened as file:
            position = 0
            for number, line in enumerate(file, start=1):
                if not line.endswith(b"\n"):
                    return
                try:
                    yield position, loads(line.decode())
                except ValueError as error:
                    raise InputError(
                        f"{self.path}, line {number}: expected a line of JSON"
                    ) from error
                position += len(line)

    def documents_at(self, positions: Iterable[int]) -> Iterator[dict[str, Any]]:
        """Yield the documents that start at given positions in the file."""
        with self.path.open("rb") as file:
            for position in positions:
                file.seek(position)
                yield loads(file.readline().decode())


def remove_incomplete_line(file: BinaryIO) -> None:
    """Remove the last line of a file if it has no newline; leave the position at the end."""
    if not file.seek(0, os.SEEK_END):
        return
    file.seek(-1, os.SEEK_END)
    if file.read(1) != b"\n":
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
    file.seek(0, os.SEEK_END)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder, so that no other series or sweep runs in it (not on Windows)."""
    fcntl = posix_module("fcntl")
    if fcntl is None:
        yield
        return
    with contextlib.ExitStack() as stack:
        try:
            # The content of the file has no meaning. It is not truncated, because it can be a file
            # of the user.
            flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
            lock = os.open(folder / LOCK, flags, 0o666)
            stack.callback(os.close, lock)
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(
                f"{folder}: another series or sweep is running in this folder"
            ) from error
        except OSError as error:
            linked = (folder / LOCK).is_symlink()
            problem = "is a symbolic link: expected none" if linked else reason(error)
            raise InputError(f"{folder / LOCK}: {problem}") from error
        yield
