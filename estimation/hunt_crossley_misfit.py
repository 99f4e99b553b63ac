"""Compute the autocovariance of the force errors of a Hunt-Crossley model.

The samples are divided into blocks of successive samples. For each block, the means of force,
velocity and displacement are stored. The force error of a block is the mean force minus the force
of the model, K x^n + B x^n v, which is computed from the mean displacement and the mean velocity.
The autocovariance is the weighted mean of the products of the force errors of successive blocks.

When the estimate of K, B and n changes, the force errors of all stored blocks are computed again.
For a model that is linear in its parameters, `estimation.misfit` uses a faster method.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.compiled import looped


class RecentBlocks:
    """Store the means of force, velocity and displacement for each recent block of samples.

    A block consists of successive samples.

    Parameters
    ----------
    count
        Largest number of stored blocks. When it is exceeded, the oldest block is discarded.
    """

    def __init__(self, count: int) -> None:
        self._blocks: deque[tuple[float, float, float, float]] = deque(maxlen=count)

    def clear(self) -> None:
        """Discard all stored blocks of samples."""
        self._blocks.clear()

    def add(self, means: Iterable[float], share: float) -> None:
        """Store the means of the signals over a new block of samples.

        Parameters
        ----------
        means
            Means of force [N], velocity [m/s] and displacement [m]. Further values are ignored.
        share
            Weight of the new block in the autocovariance c, from 0 to 1. c changes to
            (1 - share) c + share e e_before. e and e_before are the force errors of the new block
            and of the previous block. Use 0 if no block directly precedes the new block.
        """
        f, v, x, *_ = means
        self._blocks.append((f, v, x, share))

    @property
    def blocks(self) -> list[tuple[float, float, float, float]]:
        """All stored blocks of samples, oldest first.

        Each block is a tuple: mean force [N], mean velocity [m/s], mean displacement [m], and its
        weight in the autocovariance (`share` in `add`).
        """
        return list(self._blocks)

    @property
    def last(self) -> tuple[float, float, float, float]:
        """Newest block of samples, a tuple as in `blocks`."""
        return self._blocks[-1]

    def autocovariances(
        self, history: Floats, positions: NDArray[np.intp], parameters: Sequence[Floats]
    ) -> Floats:
        """Return the autocovariance of the force error [N^2] at m times, shape (m,).

        Each time is the end of a block. The result for a time is the value that the method
        `autocovariance` returns at that time.

        Parameters
        ----------
        history
            All blocks, oldest first, shape (blocks, 4). A row has the four values of `blocks`.
        positions
            For each time, the number of blocks in `history` that ended at or before it, shape (m,).
        parameters
            Estimates of K, B and n at the m times, each of shape (m,).
        """
        first = np.maximum(positions - (self._blocks.maxlen or 0), 0)
        found = np.empty(len(positions))
        f, v, x, share = history.T.copy()
        inputs = (f, v, x, share, *parameters[:3], first, positions)
        looped(window_autocovariances, (), inputs, (found,))
        return found

    def autocovariance(self, parameters: Sequence[float]) -> float:
        """Return the autocovariance of the force error [N^2].

        The force errors of all stored blocks are computed with the given parameters. The result is
        the weighted mean of the products of the force errors of successive blocks.

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
    """Update the autocovariance of the force error with a new block of samples.

    Parameters
    ----------
    covariance
        Autocovariance without the new block [N^2].
    last
        Force error of the previous block [N].
    f, v, x
        Means of force [N], velocity [m/s] and displacement [m] over the new block.
    share
        Weight of the new block, see `RecentBlocks.add`.
    stiffness, damping, n
        Parameters K, B and n of the model. The force of the model is 0 for x <= 0.

    Returns
    -------
    Autocovariance with the new block [N^2], and force error of the new block [N].
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
    """Compute the autocovariance of the force error [N^2] at m times, and write it to `found`.

    `f`, `v`, `x` and `share` have one element per block of samples. The other arguments have one
    element per time. At time j, the autocovariance is computed from the blocks first[j] to
    end[j] - 1, with K = stiffness[j], B = damping[j] and n = n[j].
    """
    for j in range(len(found)):
        covariance = 0.0
        last = 0.0
        for i in range(first[j], end[j]):
            covariance, last = include(
                covariance, last, f[i], v[i], x[i], share[i], stiffness[j], damping[j], n[j]
            )
        found[j] = covariance
