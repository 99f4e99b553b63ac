"""A ring buffer of records in memory that processes share: one writer, any number of readers.

The records have a fixed size and are numbered from 1. The writer overwrites the oldest ones. It
writes a record, and then the number of the newest record at the start of the memory. The ring has
no lock, and writing needs no system call. A reader that is slow, stopped or dead can therefore not
delay the writer.

A reader copies records, and then reads the number of the newest one again. Records that the writer
can have overwritten meanwhile are discarded.
"""

from __future__ import annotations

from mmap import mmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

HEAD = 64
"""Size of the start of the memory, which contains the number of the newest record [bytes]."""
Records = NDArray[Any]
"""Array of records, shape (n,) or (n, values)."""


def ring_size(record: np.dtype[Any], slots: int) -> int:
    """Return the size of the memory of a ring with a number of places for records [bytes]."""
    return HEAD + slots * record.itemsize


def margin(slots: int) -> int:
    """Return the number of the oldest records that are not read, as they are overwritten next."""
    return slots // 8


class RingWriter:
    """Writes records to memory of the size `ring_size`."""

    def __init__(self, memory: mmap, record: np.dtype[Any], slots: int) -> None:
        self.newest = 0
        self.memory = memory
        self._head = memoryview(memory).cast("Q")
        self._slots = np.frombuffer(memory, record, slots, HEAD)
        self._size = record.itemsize
        self._count = slots

    @property
    def place(self) -> int:
        """Offset of the next record in the memory [bytes]. Write it there, then call `publish`."""
        return HEAD + (self.newest + 1) % self._count * self._size

    def publish(self, records: int = 1) -> None:
        """Make this number of written records visible to readers."""
        self._head[0] = self.newest = self.newest + records

    def write(self, records: Records) -> None:
        """Write records in place of the oldest ones."""
        most = margin(self._count)
        for start in range(0, len(records), most):
            part = records[start : start + most]
            places = (self.newest + 1 + np.arange(len(part))) % self._count
            self._slots[places] = part
            self.publish(len(part))


class RingReader:
    """Reads the records that a `RingWriter` with the same arguments writes to the memory."""

    def __init__(self, memory: mmap, record: np.dtype[Any], slots: int) -> None:
        self._head = memoryview(memory).toreadonly().cast("Q")
        self._slots = np.frombuffer(memory, record, slots, HEAD)
        self._count = slots

    @property
    def newest(self) -> int:
        """Number of the newest record, from 1; 0 if there is no record."""
        return self._head[0]

    @property
    def oldest(self) -> int:
        """Number of the oldest record that can be read."""
        return max(1, self.newest + 1 - self._count + margin(self._count))

    def read(self, first: int, end: int) -> tuple[int, Records]:
        """Return copies of the records from number `first` to `end` - 1 that still exist.

        The result is the number of the first returned record, and the records.
        """
        start = max(first, self.oldest)
        end = max(start, min(end, self.newest + 1))
        records = self._slots[np.arange(start, end) % self._count]
        intact = min(max(start, self.oldest), end)
        return intact, records[intact - start :]
