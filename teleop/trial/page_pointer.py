"""Read the mouse or touch pointer of the live page in the control process."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from teleop.live.cells import CellReader

SILENCE = 0.15
"""Longest time between two samples of the pointer while the hand holds the handle [s]."""


class PagePointer:
    """Returns the latest sample of the pointer.

    If no new sample arrives for longer than `SILENCE`, the hand no longer holds the handle.

    Parameters
    ----------
    cells
        Shared-memory cells to which the live process writes the samples.
    now
        Function that returns the present time [s].
    """

    def __init__(self, cells: CellReader, now: Callable[[], float] = monotonic) -> None:
        self._cells = cells
        self._now = now
        self._sequence = -1
        self._time = -SILENCE
        self._depth, self._grip = 0.0, False
        if sample := cells.pointer():
            self._sequence = sample[0]

    def __call__(self) -> tuple[float, bool]:
        """Return the intended depth of the hand [m], and whether the hand holds the handle."""
        now = self._now()
        sample = self._cells.pointer()
        if sample and sample[0] != self._sequence:
            self._sequence, self._depth, self._grip = sample
            self._time = now
        return self._depth, self._grip and now - self._time <= SILENCE
