"""A ring buffer of messages in shared memory, with one process that writes and one that reads.

The ring consists of slots, and a slot stores one message. The writer overwrites the oldest
messages. The messages are numbered from 1. A slot contains the number of its message twice, before
and after the message. If the two numbers are not the number that the reader expects, the writer has
overwritten the slot, or is writing it. The reader then discards the slot.

The ring has no lock, and writing needs no system call. A reader that hangs or ends can therefore
not delay the writer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from mmap import mmap
from struct import Struct
from time import monotonic

import numpy as np
from numpy.typing import NDArray

HEAD = 64
"""Size of the head of the ring, which contains the number of the newest message [bytes]."""
SLOTS = 4096
"""Number of slots in the ring buffer for the ticks of a control loop."""
MARGIN = 64
"""Number of slots with the oldest messages. They are not read, because the writer overwrites them
next."""


def slot_type(size: int) -> np.dtype[np.void]:
    """Return the numpy type of a slot for a message of at most `size` bytes."""
    return np.dtype(
        [
            ("number", "u8"),
            ("length", "u8"),  # of the message [bytes]
            ("written", "f8"),  # time of writing [s]
            ("message", "u1", (-(-size // 8) * 8,)),
            ("again", "u8"),  # the number of the message
        ]
    )


def ring_size(slots: int, size: int) -> int:
    """Return the size of the shared memory for `slots` messages of at most `size` bytes [bytes]."""
    return HEAD + slots * slot_type(size).itemsize


class RingWriter:
    """Writes messages of at most `size` bytes to shared memory (`ring_size`)."""

    def __init__(
        self, buffer: mmap, slots: int, size: int, now: Callable[[], float] = monotonic
    ) -> None:
        self.newest = 0
        self._words = memoryview(buffer).cast("Q")
        self._buffer = buffer
        self._slots = slots
        self._size = size
        slot = slot_type(size)
        self._stride = slot.itemsize
        # A struct, because it writes the fields one by one in their order.
        self._pack = Struct(f"@QQd{slot['message'].itemsize}sQ").pack_into
        self._now = now

    def write(self, message: bytes) -> None:
        """Write a message in place of the oldest. Raise a ValueError if it is too large."""
        length = len(message)
        if length > self._size:
            raise ValueError(f"a message of {length} bytes: expected at most {self._size}")
        number = self.newest + 1
        start = HEAD + number % self._slots * self._stride
        self._pack(self._buffer, start, number, length, self._now(), message, number)
        self._words[0] = self.newest = number


class RingReader:
    """Reads messages from the shared memory of a `RingWriter` with the same `slots` and `size`."""

    def __init__(self, buffer: mmap, slots: int, size: int) -> None:
        self._newest = np.frombuffer(buffer, dtype=np.uint64, count=1)
        self._slots = np.frombuffer(buffer, dtype=slot_type(size), count=slots, offset=HEAD)

    @property
    def newest(self) -> int:
        """Number of the newest message, from 1; 0 if there is no message."""
        return int(self._newest[0])

    @property
    def oldest(self) -> int:
        """Number of the oldest message that should be read.

        Up to `MARGIN` older messages may exist, but the writer will soon overwrite them.
        """
        return max(1, self.newest - len(self._slots) + MARGIN)

    def read(self, numbers: Sequence[int]) -> tuple[list[int], NDArray[np.void]]:
        """Return numbers and slots (`slot_type`) of those wanted messages that still exist."""
        wanted = np.asarray(numbers, dtype=np.uint64)
        places = wanted % np.uint64(len(self._slots))
        # The reverse of the order of writing: a slot that is overwritten meanwhile has two numbers.
        again = self._slots["again"][places]
        slots = self._slots[places]
        number = self._slots["number"][places]
        intact = (again == wanted) & (number == wanted)
        return wanted[intact].tolist(), slots[intact]
