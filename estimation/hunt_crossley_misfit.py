"""Compute the autocovariance of the force errors of a Hunt-Crossley model.

The samples are divided into blocks of successive samples (`estimation.misfit`). The autocovariance
is computed from the mean force error in each of the recent blocks. The force K x^n + B x^n v is not
linear in n. When the estimate of n changes, the force errors of past blocks can therefore not be
computed from sums of products. Instead, the means of force, velocity and displacement over the
recent blocks are stored. The force errors of all these blocks are computed with the present
estimate.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats, looped


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
            Weight of this block in the autocovariance. The autocovariance is a weighted mean.
            The new block adds the product of its force error and the force error of the previous
            block. The weight is 0 if there is no previous block.
        """
        f, v, x, *_ = means
        self._blocks.append((f, v, x, share))

    @property
    def blocks(self) -> list[tuple[float, float, float, float]]:
        """Means of force, velocity and displacement, and `share` (see `add`), for each block."""
        return list(self._blocks)

    @property
    def last(self) -> tuple[float, float, float, float]:
        """Means of force, velocity and displacement, and `share`, for the last block."""
        return self._blocks[-1]

    def autocovariances(
        self, history: Floats, positions: NDArray[np.intp], parameters: Sequence[Floats]
    ) -> Floats:
        """Return the autocovariance [N^2] at several times, shape (times,).

        Each time is the end of a block. The autocovariance is that of the method `autocovariance`.

        Parameters
        ----------
        history
            All blocks, shape (blocks, 4). The columns are those of `blocks`.
        positions
            Number of blocks in `history` until each of the times, shape (times,).
        parameters
            Estimates of K, B and n at these times, each of shape (times,).
        """
        first = np.maximum(positions - (self._blocks.maxlen or 0), 0)
        found = np.empty(len(positions))
        f, v, x, share = history.T.copy()
        inputs = (f, v, x, share, *parameters[:3], first, positions)
        looped(window_autocovariances, (), inputs, (found,))
        return found

    def autocovariance(self, parameters: Sequence[float]) -> float:
        """Return the weighted mean of the products of successive force errors [N^2].

        Parameters
        ----------
        parameters
            Present estimates of K, B and n. The force of the model is 0 for x <= 0.
        """
        stiffness, damping, n = parameters[:3]
        covariance = last = 0.0
        for f, v, x, share in self._blocks:
            covariance, last = include(covariance, last, f, v, x, share, stiffness, damping, n)
        return covariance


def include(
    covariance: float,
    last: float,
    f: float,
    v: float,
    x: float,
    share: float,
    stiffness: float,
    damping: float,
    n: float,
) -> tuple[float, float]:
    """Add a block to the autocovariance of the force error from one block to the next.

    Returns the new autocovariance [N^2], and the force error of this block [N].

    Parameters
    ----------
    covariance, last
        Autocovariance without this block [N^2], and force error of the previous block [N].
    f, v, x, share
        The block, as in `RecentBlocks.blocks`.
    stiffness, damping, n
        K, B and n of the model. The force of the model is 0 for x <= 0.
    """
    error = f
    if x > 0.0:
        error = f - (stiffness + damping * v) * x**n
    if share > 0.0:
        covariance += share * (error * last - covariance)
    return covariance, error


def window_autocovariances(
    f: Sequence[float],
    v: Sequence[float],
    x: Sequence[float],
    share: Sequence[float],
    stiffness: Sequence[float],
    damping: Sequence[float],
    n: Sequence[float],
    first: Sequence[int],
    end: Sequence[int],
    found: list[float],
) -> None:
    """Compute the results of `RecentBlocks.autocovariances`, and write them to `found`.

    `found[j]` is computed from the blocks first[j] to end[j] - 1, with the parameters K, B and n in
    `stiffness[j]`, `damping[j]` and `n[j]`.
    """
    for j in range(len(found)):
        covariance = 0.0
        last = 0.0
        for i in range(first[j], end[j]):
            covariance, last = include(
                covariance, last, f[i], v[i], x[i], share[i], stiffness[j], damping[j], n[j]
            )
        found[j] = covariance
