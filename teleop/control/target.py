"""Sinusoidal target of the condition `mimic`, which the operator follows with the slave."""

from __future__ import annotations

import math
from dataclasses import dataclass

TOUCH = 0.1
"""Smallest target position as a fraction of the depth; > 0 so that the slave stays in contact."""


@dataclass(frozen=True)
class Target:
    """Sinusoidal target position of the slave, which the operator follows.

    At the start of a trial, the target does not move. This time is the count-in. The target
    position is then `TOUCH` times the depth. After the count-in, the target moves between this
    position and the depth. Its position is

        depth (TOUCH + (1 - TOUCH) (1 - cos(2 pi f t)) / 2)

    f is `frequency`, and t is the time since the end of the count-in.
    """

    frequency: float
    """Frequency f [Hz], > 0."""
    depth: float
    """Largest target position of the slave [m], > 0."""
    count_in: float = 0.0
    """Time at the start of a trial during which the target does not move [s], >= 0."""

    @property
    def shortest(self) -> float:
        """Shortest duration of a trial [s] that is sufficient to compute the tracking error.

        This duration is the sum of the count-in (the time before the target starts to move) and two
        periods of the target. The tracking error is the slave position minus the target.
        """
        return self.count_in + 2.0 / self.frequency

    def position(self, t: float) -> float:
        """Return the target position of the slave [m]."""
        angle = 2.0 * math.pi * self.frequency * max(t - self.count_in, 0.0)
        return self.depth * (TOUCH + 0.5 * (1.0 - TOUCH) * (1.0 - math.cos(angle)))
