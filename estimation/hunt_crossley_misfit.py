"""Compute the autocovariance of the force errors of a Hunt-Crossley model over recent blocks.

A block is a number of successive samples (`estimation.misfit`). The force K x^n + B x^n v is not
linear in n, so sums of products of past samples are not sufficient when the estimate changes.
Instead, the means over the recent blocks are stored. The force errors of all these blocks are
computed with the present estimate.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence


class RecentBlocks:
    """Stores the means of force, velocity and displacement over each of the recent blocks.

    Parameters
    ----------
    count
        Largest number of stored blocks.
    """

    def __init__(self, count: int) -> None:
        self._blocks: deque[tuple[float, float, float, float]] = deque(maxlen=count)

    def clear(self) -> None:
        """Discard all blocks."""
        self._blocks.clear()

    def add(self, means: Iterable[float], share: float) -> None:
        """Store the means over a new block.

        Parameters
        ----------
        means
            Means of force [N], velocity [m/s] and displacement [m]. Further values are ignored.
        share
            Weight of the product of this block and the previous block; 0 if there is no
            previous block.
        """
        f, v, x, *_ = means
        self._blocks.append((f, v, x, share))

    def autocovariance(self, parameters: Sequence[float]) -> float:
        """Return the weighted mean product of successive force errors [N^2].

        Parameters
        ----------
        parameters
            Present estimates of K, B and n. The force of the model is 0 for x <= 0.
        """
        stiffness, damping, n = parameters[:3]
        covariance = last = 0.0
        for f, v, x, share in self._blocks:
            error = f - (stiffness + damping * v) * x**n if x > 0.0 else f
            if share > 0.0:
                covariance += share * (error * last - covariance)
            last = error
        return covariance
