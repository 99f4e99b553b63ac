"""Store the latest rows of data for the live page, and convert them to binary messages (frames).

A row contains the values of one tick of the control loop.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from estimation.arrays import Floats


SHOWN = 10.0
"""Length of the time axis of the live page [s]."""
MOST_ROWS = 250.0
"""Largest number of rows that are sent to the live page per second."""
HEAD = struct.Struct("<IIIId")
"""Layout of the head of a frame: kind, number of rows, number of columns, flags, time of sending
[s]."""
TICKS = 1
"""Kind of a frame that contains rows of ticks."""
CLEAR = 1
"""Flag of a frame whose rows replace all rows that the page shows."""
LARGEST_FRAME = 32_000
"""Largest total size of the rows in a frame [bytes]."""


def decimation(rate: float) -> int:
    """Return the smallest distance between two ticks that are sent to the live page [ticks].

    Not every tick of the control loop is sent, because at most `MOST_ROWS` ticks are sent per
    second.

    Parameters
    ----------
    rate
        Rate of the control loop [Hz].
    """
    return max(1, int(np.ceil(rate / MOST_ROWS)))


def decimated(first: int, end: int, last: int, step: int) -> list[int]:
    """Return the numbers of the ticks that are sent to the live page, from a range of new ticks.

    These are the last tick of the range, and every `step`-th tick before it. A tick that is closer
    than `step` to the tick that was sent before is not sent.

    Parameters
    ----------
    first, end
        The range contains the ticks from number `first` up to but not including number `end`.
    last
        Number of the latest tick that was sent before.
    step
        Smallest difference between the numbers of two ticks that are sent.
    """
    return list(range(end - 1, max(first - 1, last + step - 1), -step))[::-1]


class History:
    """Ring buffer of the latest rows of data for the live page.

    A row contains the values of one tick of the control loop. If the buffer is full, new rows
    overwrite the oldest rows.

    Parameters
    ----------
    columns
        Number of columns.
    rows
        Number of rows that the buffer can store.
    now
        Function that returns the present time [s]. Each frame (binary message to a page) contains
        the time at which it was created.

    Attributes
    ----------
    epoch
        Integer that increases when the rows are cleared, or when a new trial begins. A page must
        then remove the rows that it shows.
    end
        Index of the next row that will be added. Rows are numbered from 0 in the order in which
        they are added. `clear` does not change this index.
    """

    def __init__(
        self,
        columns: int,
        rows: int = int(SHOWN * MOST_ROWS) + 100,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._rows = np.zeros((rows, columns))
        self._now = now
        self._start = 0
        self.epoch = 0
        self.end = 0

    @property
    def start(self) -> int:
        """Index of the oldest row in the buffer. Rows are numbered from 0 as they are added."""
        return max(self._start, self.end - len(self._rows))

    def add(self, rows: Floats) -> None:
        """Add rows to the buffer. They have the shape (n, columns), and the oldest row is first."""
        rows = rows[-len(self._rows) :]
        places = (self.end + np.arange(len(rows))) % len(self._rows)
        self._rows[places] = rows
        self.end += len(rows)

    def clear(self) -> None:
        """Remove all rows. Because `epoch` changes, the open pages then also remove their rows."""
        self.epoch += 1
        self._start = self.end

    def frame(self, first: int, clear: bool) -> tuple[bytes, int]:
        """Return a frame (binary message to a page), and the index after its last row.

        The frame contains rows from the index `first` on. `LARGEST_FRAME` limits the number of rows
        in a frame.

        Parameters
        ----------
        first
            Index of the first row. Rows that are no longer in the buffer are omitted.
        clear
            Whether the rows replace all rows that the page shows.
        """
        count = self._rows.shape[1]
        first = max(first, self.start)
        end = min(self.end, first + max(1, LARGEST_FRAME // (8 * max(count, 1))))
        rows = self._rows[np.arange(first, end) % len(self._rows)]
        head = HEAD.pack(TICKS, len(rows), count, CLEAR if clear else 0, self._now())
        return head + rows.astype("<f8").tobytes(), end
