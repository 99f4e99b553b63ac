"""The target of the mimic condition: a sine that the operator follows with the slave."""

from __future__ import annotations

import math
from dataclasses import dataclass

TOUCH = 0.1
"""Smallest displacement of the target as a fraction of the depth; contact is kept."""


@dataclass(frozen=True)
class Target:
    """Position of the slave that the operator follows.

    It moves between a light touch and the depth: x(t) = depth (0.1 + 0.45 (1 - cos(2 pi f t)))
    from the end of the count-in, and stays at the light touch before.
    """

    frequency: float
    """Frequency f [Hz], > 0."""
    depth: float
    """Greatest displacement of the slave [m], > 0."""
    count_in: float = 0.0
    """Time during which the target stays at the light touch [s], >= 0."""

    @property
    def shortest(self) -> float:
        """Duration of the count-in and two periods [s], from which tracking can be computed."""
        return self.count_in + 2.0 / self.frequency

    def position(self, t: float) -> float:
        """Return the target [m] at time t [s] since the drives were armed."""
        angle = 2.0 * math.pi * self.frequency * max(t - self.count_in, 0.0)
        return self.depth * (TOUCH + 0.5 * (1.0 - TOUCH) * (1.0 - math.cos(angle)))
