"""Show target and slave position in a bar of characters, in the condition `mimic`."""

from __future__ import annotations

import math
from dataclasses import dataclass

WIDTH = 30
"""Number of characters of the bar between its ends."""
TARGET, OWN, BOTH = "O", "x", "@"
"""Marks of the target, of the position of the slave, and of both at the same place."""
LEGEND = f"follow {TARGET} with {OWN}; {BOTH} where both are at the same place"


@dataclass(frozen=True)
class Cue:
    """Bar of characters on the terminal that shows the target and the position of the slave.

    Attributes
    ----------
    depth
        Largest displacement of the target [m], which determines the range of the bar.
    count_in
        Time at the start of the trial during which the target does not move [s].
    """

    depth: float
    count_in: float

    def text(self, t: float, target: float, position: float) -> str:
        """Return the bar as text.

        Before the target begins to move, the remaining seconds follow the bar.

        Parameters
        ----------
        t
            Time of the trial [s].
        target, position
            Position of the target and position of the slave [m]; NaN if the position is not known.
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
        """Return the index of the character of the bar that marks a position x [m].

        The result is None if x is NaN. The bar shows positions from -0.1 to 1.1 times the attribute
        `depth`. A position outside this range is marked at the nearer end of the bar.
        """
        if math.isnan(x):
            return None
        share = (x / self.depth + 0.1) / 1.2
        return min(max(round(share * (WIDTH - 1)), 0), WIDTH - 1)
