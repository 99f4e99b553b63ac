"""Cells in shared memory, which transfer the requests of the live page to the control loop.

The live process writes the cells, and the control process reads them at each tick. A cell has 8
bytes, which a processor writes in one operation, so that no lock is needed. The state of the
pointer needs two cells, depth and grip. The live process increases a sequence number by one before
it writes these two cells, and again afterwards. While it writes, the sequence number is therefore
odd. The control process reads the sequence number before and after the two cells. The two values
belong together if the sequence number was even and has not changed.
"""

from __future__ import annotations

from mmap import mmap

SIZE = 4096
"""Size of the shared memory [bytes]."""
STOP, END, ARM, PROCESS, PAGE, SEQUENCE, DEPTH, GRIP = range(8)
"""Indices of the cells: counters of the requests STOP, END and ARM, heartbeats of live process and
page, and three cells for the pointer."""


class CellWriter:
    """Writes the requests to the cells; used by the live process.

    Parameters
    ----------
    buffer
        Shared memory of `SIZE` bytes.
    """

    def __init__(self, buffer: mmap) -> None:
        self._counts = memoryview(buffer).cast("Q")
        self._numbers = memoryview(buffer).cast("d")

    def count(self, cell: int) -> None:
        """Increase the counter in a cell by one. A heartbeat is also stored as a counter."""
        self._counts[cell] += 1

    def point(self, depth: float, grip: bool) -> None:
        """Write the intended depth of the hand [m], and whether the hand holds the handle."""
        self._counts[SEQUENCE] += 1
        self._numbers[DEPTH] = depth
        self._counts[GRIP] = grip
        self._counts[SEQUENCE] += 1


class CellReader:
    """Reads the requests from the cells; used by the control process.

    Parameters
    ----------
    buffer
        Shared memory of `SIZE` bytes.
    """

    def __init__(self, buffer: mmap) -> None:
        self.counts = memoryview(buffer).toreadonly().cast("Q")
        """Values of the counters and heartbeats, by the index of the cell."""
        self._numbers = memoryview(buffer).toreadonly().cast("d")

    def pointer(self) -> tuple[int, float, bool] | None:
        """Return the sequence number, the depth [m], and whether the handle is held.

        Return None while the live process writes these values.
        """
        counts = self.counts
        before = counts[SEQUENCE]
        depth, grip = self._numbers[DEPTH], counts[GRIP]
        if before & 1 or counts[SEQUENCE] != before:
            return None
        return before, depth, bool(grip)
