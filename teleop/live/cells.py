"""Cells in shared memory, which transfer the requests of the live page to the control loop.

The live process writes the cells, and the control process reads them at each tick. A cell contains
one number of 8 bytes. A processor writes 8 bytes in one operation, so that no lock is needed.

The state of the pointer needs two cells. The live process increases a sequence number before it
writes them, and again afterwards, so that it is odd during the writing. The two values belong
together if the control process reads the same even number before and after them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from mmap import mmap

SIZE = 4096
"""Size of the shared memory [bytes]."""
STOP, END, ARM, PROCESS, SEEN, SEQUENCE, DEPTH, GRIP = range(8)
"""Indices of the cells: counters of the requests STOP, END and ARM, counter of the heartbeats of
the live process, time of the newest data that the page in control has confirmed, and three cells
for the state of the pointer."""
LONGEST_ROUND_TRIP = 0.3
"""Longest round trip of the connection to a live page that may arm the drives or hold the handle
[s]. With a longer delay, a person can no longer control a motion continuously, but moves and waits
(Ferrell 1965), and the delay exceeds the person's own reaction time (0.25 s)."""


class CellWriter:
    """Writes the requests of the live page to `SIZE` bytes of shared memory (live process)."""

    def __init__(self, buffer: mmap) -> None:
        self._counts = memoryview(buffer).cast("Q")
        self._numbers = memoryview(buffer).cast("d")

    def count(self, cell: int) -> None:
        """Increase the counter in a cell by one, to send one request or one heartbeat."""
        self._counts[cell] += 1

    def confirm(self, seen: float) -> None:
        """Write the time of the newest data that the page in control has confirmed [s].

        It is the time at which the live process sent these data, on the monotonic clock of the
        machine, which all processes share.
        """
        self._numbers[SEEN] = seen

    def point(self, depth: float, grip: bool) -> None:
        """Write the wanted position of the hand [m], and whether the hand holds the handle."""
        self._counts[SEQUENCE] += 1
        self._numbers[DEPTH] = depth
        self._counts[GRIP] = grip
        self._counts[SEQUENCE] += 1


class CellReader:
    """Reads the requests of the live page from `SIZE` bytes of shared memory (control process)."""

    def __init__(self, buffer: mmap) -> None:
        self.counts = memoryview(buffer).toreadonly().cast("Q")
        """Values of the counters of requests and heartbeats, by the index of the cell."""
        self._numbers = memoryview(buffer).toreadonly().cast("d")

    def age(self, now: Callable[[], float]) -> float:
        """Return the age of the newest data that the page in control has confirmed [s].

        It is infinite if the time of these data is not possible, for example in the future.
        Otherwise such a time would hide the loss of the page. `now` is a function, because the cell
        must be read first: the live process may write it at any time.
        """
        seen = self._numbers[SEEN]
        age = now() - seen
        return age if age >= 0.0 else math.inf

    def pointer(self) -> tuple[int, float, bool] | None:
        """Return the state of the pointer; None while the live process writes it.

        The state is a number that changes with each state, the wanted position of the hand [m], and
        whether the hand holds the handle.
        """
        counts = self.counts
        before = counts[SEQUENCE]
        depth, grip = self._numbers[DEPTH], counts[GRIP]
        if before & 1 or counts[SEQUENCE] != before:
            return None
        return before, depth, bool(grip)
