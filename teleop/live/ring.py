"""A ring buffer of messages in shared memory, with one process that writes and one that reads.

The ring buffer (ring) consists of slots, and a slot stores one message. The writer overwrites the
oldest messages. The messages are numbered from 1. A slot contains the number of its message twice,
before and after the message. If the two numbers are not the number that the reader expects, the
writer has overwritten the slot, or is writing it. The reader then discards the slot.

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
BEFORE = 24
"""Size of the part of a slot before the message [bytes]. This part contains number, length and time
of writing of the message."""
AFTER = 8
"""Size of the part of a slot after the message [bytes]. It contains the number again."""
SLOTS = 4096
"""Number of slots in the ring buffer for the ticks of a control loop."""
MARGIN = 64
"""Number of slots with the oldest messages. They are not read, because the writer overwrites them
next."""


def stride(size: int) -> int:
    """Return the size of one slot of a ring buffer [bytes].

    A slot stores one message. `size` is the largest size of a message [bytes].
    """
    return BEFORE + -(-size // 8) * 8 + AFTER


def ring_size(slots: int, size: int) -> int:
    """Return the size of the shared memory of a ring buffer [bytes].

    Parameters
    ----------
    slots
        Number of slots. A slot stores one message.
    size
        Largest size of a message [bytes].
    """
    return HEAD + slots * stride(size)


class RingWriter:
    """Writes messages to a ring buffer in shared memory.

    Parameters
    ----------
    buffer
        Shared memory of `ring_size(slots, size)` bytes.
    slots
        Number of slots. A slot stores one message.
    size
        Largest size of a message [bytes].
    now
        Function that returns the present time [s]. This time is stored with each message.

    Attributes
    ----------
    newest
        Number of the newest message, from 1; 0 if there is no message.
    """

    def __init__(
        self, buffer: mmap, slots: int, size: int, now: Callable[[], float] = monotonic
    ) -> None:
        self.newest = 0
        self._words = memoryview(buffer).cast("Q")
        self._buffer = buffer
        self._slots = slots
        self._size = size
        self._stride = stride(size)
        self._pack = Struct(f"@QQd{stride(size) - BEFORE - AFTER}sQ").pack_into
        self._now = now

    def write(self, message: bytes) -> None:
        """Write a message into the next slot, in place of the oldest message if all slots are used.

        Raises
        ------
        ValueError
            The message is larger than the largest size of a message.
        """
        length = len(message)
        if length > self._size:
            raise ValueError(f"a message of {length} bytes: expected at most {self._size}")
        number = self.newest + 1
        start = HEAD + number % self._slots * self._stride
        # The fields are written in this order: a number is before and after the message.
        self._pack(self._buffer, start, number, length, self._now(), message, number)
        self._words[0] = self.newest = number


class RingReader:
    """Reads messages from a ring buffer in shared memory.

    Parameters
    ----------
    buffer
        Shared memory of `ring_size(slots, size)` bytes.
    slots
        Number of slots. A slot stores one message.
    size
        Largest size of a message [bytes].
    """

    def __init__(self, buffer: mmap, slots: int, size: int) -> None:
        data = np.frombuffer(buffer, dtype=np.uint8, count=ring_size(slots, size))
        self._newest = data[:8].view(np.uint64)
        self._rows = data[HEAD:].reshape(slots, stride(size))
        self._slots = slots

    @property
    def newest(self) -> int:
        """Number of the newest message, from 1; 0 if there is no message."""
        return int(self._newest[0])

    @property
    def oldest(self) -> int:
        """Number of the oldest message that should be read. The messages are numbered from 1.

        The ring buffer can also contain up to `MARGIN` older messages. They should not be read,
        because the writer will soon overwrite them.
        """
        return max(1, self.newest - self._slots + MARGIN)

    def read(self, numbers: Sequence[int]) -> tuple[list[int], NDArray[np.uint8]]:
        """Return those of the wanted messages that the ring buffer still contains.

        Parameters
        ----------
        numbers
            Numbers of the wanted messages, each at least 1.

        Returns
        -------
        found
            Numbers of the messages that are returned.
        slots
            Array with one row of bytes for each message in `found`. A row contains, in this order:
            the length of the message as an unsigned integer of 64 bits, the time of writing [s] as
            a double, the message, and unused bytes.
        """
        wanted = np.asarray(numbers, dtype=np.uint64)
        places = wanted % np.uint64(self._slots)
        after = self._rows[places, -AFTER:].copy().view(np.uint64)[:, 0]
        slots = self._rows[places, 8:-AFTER]
        before = self._rows[places, :8].copy().view(np.uint64)[:, 0]
        intact = (after == wanted) & (before == wanted)
        return [int(number) for number in wanted[intact]], slots[intact]
