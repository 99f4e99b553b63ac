"""Read the pointer of the live page in the process of the control loop.

The hand of a simulated operator can follow the pointer.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from teleop.live.cells import LONGEST_ROUND_TRIP, CellReader

SILENCE = 0.15
"""Longest time between two samples of the pointer while the hand holds the handle [s]."""


class PagePointer:
    """Callable that returns the latest position of the pointer in the live page.

    The hand of a simulated operator follows the pointer. If no new sample of the pointer arrives
    for longer than `SILENCE`, the hand no longer holds the handle. It does not hold the handle
    either while the page is more than `LONGEST_ROUND_TRIP` behind, because the person then sees and
    moves too late.
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
        """Return the wanted position of the hand [m], and whether the hand holds the handle.

        A person sets both with the pointer in the live page.
        """
        now = self._now()
        sample = self._cells.pointer()
        if sample and sample[0] != self._sequence:
            self._sequence, self._depth, self._grip = sample
            self._time = now
        is_late = self._cells.age(self._now) > LONGEST_ROUND_TRIP
        return self._depth, self._grip and now - self._time <= SILENCE and not is_late
