"""The cue of the mimic condition: target and own position as marks on a bar."""

from __future__ import annotations

import math
from dataclasses import dataclass

WIDTH = 30
"""Number of characters of the bar between its ends."""
TARGET, OWN, BOTH = "O", "x", "@"
"""Marks of the target, of the own position, and of both at the same place."""
LEGEND = f"follow {TARGET} with {OWN}; {BOTH} where both are at the same place"


@dataclass(frozen=True)
class Cue:
    """Range of the bar, and the count-in.

    Attributes
    ----------
    depth
        Greatest displacement of the target [m].
    count_in
        Time in which the target stands still at first [s].
    """

    depth: float
    count_in: float

    def text(self, t: float, target: float, position: float) -> str:
        """Return the bar and, before the target moves, the seconds that are left.

        Parameters
        ----------
        t
            Time of the trial [s].
        target, position
            Target and position of the slave [m]; NaN for none.
        """
        cells = [" "] * WIDTH
        own, aim = self._place(position), self._place(target)
        if own is not None:
            cells[own] = OWN
        if aim is not None:
            cells[aim] = BOTH if aim == own else TARGET
        left = math.ceil(self.count_in - max(t, 0.0))
        return f"|{''.join(cells)}|" + (f" in {left}" if left > 0 else "")

    def _place(self, x: float) -> int | None:
        """Return the cell of a position; the bar extends a tenth of the depth beyond both ends."""
        if math.isnan(x):
            return None
        share = (x / self.depth + 0.1) / 1.2
        return min(max(round(share * (WIDTH - 1)), 0), WIDTH - 1)
