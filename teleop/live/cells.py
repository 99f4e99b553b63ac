"""Cells in shared memory with the requests of the live page, which the loop reads once a tick.

The live process writes, and the control process reads. A cell has 8 bytes, which a processor
writes at once, so that no lock is needed. The pointer consists of two cells, which belong together
if the sequence number is even and the same before and after.
"""

from __future__ import annotations

from mmap import mmap

SIZE = 4096
"""Size of the shared memory [bytes]."""
STOP, END, ARM, PROCESS, PAGE, SEQUENCE, DEPTH, GRIP = range(8)
"""Cells: counters of three requests, two heartbeats, and the pointer."""


class CellWriter:
    """Writes the requests; for the live process.

    Parameters
    ----------
    buffer
        Shared memory of `SIZE` bytes.
    """

    def __init__(self, buffer: mmap) -> None:
        self._counts = memoryview(buffer).cast("Q")
        self._numbers = memoryview(buffer).cast("d")

    def count(self, cell: int) -> None:
        """Increase a counter or a heartbeat by one."""
        self._counts[cell] += 1

    def point(self, depth: float, grip: bool) -> None:
        """Write the intended depth of the hand [m], and whether it holds the handle."""
        self._counts[SEQUENCE] += 1
        self._numbers[DEPTH] = depth
        self._counts[GRIP] = grip
        self._counts[SEQUENCE] += 1


class CellReader:
    """Reads the requests; for the control process.

    Parameters
    ----------
    buffer
        Shared memory of `SIZE` bytes.
    """

    def __init__(self, buffer: mmap) -> None:
        self.counts = memoryview(buffer).toreadonly().cast("Q")
        """Counters and heartbeats, by the number of the cell."""
        self._numbers = memoryview(buffer).toreadonly().cast("d")

    def pointer(self) -> tuple[int, float, bool] | None:
        """Return sequence number, depth [m] and grip; None while they are being written."""
        counts = self.counts
        before = counts[SEQUENCE]
        depth, grip = self._numbers[DEPTH], counts[GRIP]
        if before & 1 or counts[SEQUENCE] != before:
            return None
        return before, depth, bool(grip)
