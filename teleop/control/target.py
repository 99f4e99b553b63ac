"""Target of the condition `mimic`: a sine that the operator follows with the slave."""

from __future__ import annotations

import math
from dataclasses import dataclass

TOUCH = 0.1
"""Smallest target displacement as a fraction of the depth; > 0 so that the slave stays in
contact."""


@dataclass(frozen=True)
class Target:
    """Target position of the slave, which the operator follows.

    The count-in is the time at the start of the trial during which the target does not move. The
    target position is then 0.1 times the depth. After the count-in, the target position is
    depth (0.1 + 0.45 (1 - cos(2 pi f t))). f is `frequency`, and t is the time since the
    end of the count-in.
    """

    frequency: float
    """Frequency f [Hz], > 0."""
    depth: float
    """Largest displacement of the slave [m], > 0."""
    count_in: float = 0.0
    """Time at the start during which the target is constant [s], >= 0."""

    @property
    def shortest(self) -> float:
        """Duration [s] of the shortest trial for which the tracking error is computed.

        This duration is the sum of the count-in and two periods of the target.
        """
        return self.count_in + 2.0 / self.frequency

    def position(self, t: float) -> float:
        """Return the target position [m] at time t [s] after the drives were armed."""
        angle = 2.0 * math.pi * self.frequency * max(t - self.count_in, 0.0)
        return self.depth * (TOUCH + 0.5 * (1.0 - TOUCH) * (1.0 - math.cos(angle)))
