"""Keep the latest rows of data for the live page, and convert them to frames (binary messages)."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable

import numpy as np

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
    """Return the smallest distance between two ticks that are sent to the page [ticks]."""
    return max(1, int(np.ceil(rate / MOST_ROWS - 1e-6)))  # a measured rate is not exact


def decimated(first: int, end: int, last: int, step: int) -> list[int]:
    """Return the numbers of the ticks that are sent, from the new ticks `first` to `end` - 1.

    These are the last tick, and every `step`-th tick before it, but none that is closer than `step`
    to the tick `last` that was sent before.
    """
    return list(range(end - 1, max(first - 1, last + step - 1), -step))[::-1]


class History:
    """Ring buffer of the latest rows; a row contains the shown values of one tick."""

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
        """Increases when the rows are cleared, or when a new trial begins."""
        self.end = 0
        """Number of the next row. Rows are numbered from 0 on; `clear` does not change this."""

    @property
    def start(self) -> int:
        """Number of the oldest row in the buffer."""
        return max(self._start, self.end - len(self._rows))

    def add(self, rows: Floats) -> None:
        """Add rows of shape (n, columns), the oldest first."""
        rows = rows[-len(self._rows) :]
        places = (self.end + np.arange(len(rows))) % len(self._rows)
        self._rows[places] = rows
        self.end += len(rows)

    def latest(self, count: int) -> Floats:
        """Return the latest rows, at most `count`, the oldest first."""
        numbers = np.arange(max(self.start, self.end - count), self.end)
        return np.asarray(self._rows[numbers % len(self._rows)])

    def clear(self) -> None:
        """Remove all rows. Because `epoch` changes, the open pages then also remove their rows."""
        self.epoch += 1
        self._start = self.end

    def frame(self, first: int, clear: bool) -> tuple[bytes, int]:
        """Return a frame with the rows from number `first` on, and the number after its last row.

        `LARGEST_FRAME` limits the number of rows. With `clear`, they replace all rows of the page.
        """
        count = self._rows.shape[1]
        first = max(first, self.start)
        end = min(self.end, first + max(1, LARGEST_FRAME // (8 * max(count, 1))))
        rows = self._rows[np.arange(first, end) % len(self._rows)]
        head = HEAD.pack(TICKS, len(rows), count, CLEAR if clear else 0, self._now())
        return head + rows.astype("<f8").tobytes(), end
