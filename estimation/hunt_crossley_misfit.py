"""Autocovariance of the force errors of a Hunt-Crossley model over recent blocks of samples.

The force K x^n + B x^n v is not linear in n. Sums of products of past samples are therefore not
sufficient for a new estimate (`estimation.misfit`). Instead, the means of the recent blocks are
stored, and the force errors of all these blocks are computed with the present estimate.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence


class RecentBlocks:
    """Means of force, velocity and displacement over the recent blocks.

    Parameters
    ----------
    count
        Number of blocks that are kept.
    """

    def __init__(self, count: int) -> None:
        self._blocks: deque[tuple[float, float, float, float]] = deque(maxlen=count)

    def clear(self) -> None:
        """Discard all blocks."""
        self._blocks.clear()

    def add(self, means: Iterable[float], share: float) -> None:
        """Add a block.

        Parameters
        ----------
        means
            Means of force [N], velocity [m/s] and displacement [m]; further values are ignored.
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
            K, B and n of the model. Its force is 0 for x <= 0.
        """
        stiffness, damping, n = parameters[:3]
        covariance = last = 0.0
        for f, v, x, share in self._blocks:
            error = f - (stiffness + damping * v) * x**n if x > 0.0 else f
            if share > 0.0:
                covariance += share * (error * last - covariance)
            last = error
        return covariance
