"""Cells in shared memory, which transfer the requests of the live page to the control loop.

The live process (which serves the page) writes the cells. The control process reads them at each
tick of the control loop. A cell contains one number of 8 bytes. A processor writes 8 bytes in one
operation, so that no lock is needed.

The hand of a simulated operator can follow the mouse or touch pointer of the page. The state of the
pointer needs two cells: the depth, and whether the hand holds the handle. The live process
increases a sequence number by one before it writes these two cells, and again afterwards. The
sequence number is therefore odd during the writing. The control process reads the sequence number
before and after it reads the two cells. The two values belong together if both readings of the
sequence number are equal and even.
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
    """Writes the requests of the live page to cells in shared memory.

    The live process, which serves the page, uses this class. The control process reads the cells.

    Parameters
    ----------
    buffer
        Shared memory of `SIZE` bytes.
    """

    def __init__(self, buffer: mmap) -> None:
        self._counts = memoryview(buffer).cast("Q")
        self._numbers = memoryview(buffer).cast("d")

    def count(self, cell: int) -> None:
        """Increase the counter in a cell by one, to send one request or one heartbeat.

        Parameters
        ----------
        cell
            Index of the cell, such as `STOP`.
        """
        self._counts[cell] += 1

    def confirm(self, seen: float) -> None:
        """Write the time of the newest data that the page in control has confirmed.

        Parameters
        ----------
        seen
            Time at which the live process sent these data [s], on the monotonic clock of the
            machine, which all processes share.
        """
        self._numbers[SEEN] = seen

    def point(self, depth: float, grip: bool) -> None:
        """Write the state of the pointer, which moves the hand of a simulated operator.

        Parameters
        ----------
        depth
            Wanted position of the hand [m].
        grip
            Whether the hand holds the handle.
        """
        self._counts[SEQUENCE] += 1
        self._numbers[DEPTH] = depth
        self._counts[GRIP] = grip
        self._counts[SEQUENCE] += 1


class CellReader:
    """Reads the requests of the live page from cells in shared memory.

    The control process uses this class. The live process, which serves the page, writes the cells.

    Parameters
    ----------
    buffer
        Shared memory of `SIZE` bytes.
    """

    def __init__(self, buffer: mmap) -> None:
        self.counts = memoryview(buffer).toreadonly().cast("Q")
        """Values of the counters of requests and heartbeats, by the index of the cell."""
        self._numbers = memoryview(buffer).toreadonly().cast("d")

    def age(self, now: Callable[[], float]) -> float:
        """Return the age of the newest data that the page in control has confirmed [s].

        It is infinite if the time of these data is not possible, for example in the future.
        Otherwise such a time would hide the loss of the page.

        Parameters
        ----------
        now
            Function that returns the present time [s], on the clock of `CellWriter.confirm`. The
            cell is read first, because the live process may write it at any time.
        """
        seen = self._numbers[SEEN]
        age = now() - seen
        return age if age >= 0.0 else math.inf

    def pointer(self) -> tuple[int, float, bool] | None:
        """Return the state of the pointer, which moves the hand of a simulated operator.

        Returns
        -------
        Three values: a number that changes whenever the live process writes a state, the wanted
        position of the hand [m], and whether the hand holds the handle. None while the live process
        writes.
        """
        counts = self.counts
        before = counts[SEQUENCE]
        depth, grip = self._numbers[DEPTH], counts[GRIP]
        if before & 1 or counts[SEQUENCE] != before:
            return None
        return before, depth, bool(grip)
