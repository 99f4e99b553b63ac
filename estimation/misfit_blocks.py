"""Compute sums over blocks of successive samples.

The misfit of an estimate, which is the systematic part of its force error, is computed from these
sums (`estimation.misfit`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats


class BlockEnds(NamedTuple):
    """Sums at the end of each block of successive samples, for an array of samples.

    `Misfit.ends` returns these sums. `Misfit.series` computes the misfit of an estimate from them.
    A block is counted only if another block is directly before it. In the shapes of the
    arrays, `blocks` is the number of these blocks.
    """

    at: NDArray[np.intp]
    """Index of the last sample of each block, shape (blocks,)."""
    samples: int
    """Number of samples in the array."""
    products: Floats
    """Products of the means over successive blocks, shape (blocks, size, size).

    Let u = (f, v, x, further regressors) be the means over a block, shape (size,). The element i, j
    is a weighted mean of the product of u_i of a block and u_j of the previous block.
    """
    square: Floats
    """Weighted mean of the square of the mean force in a block [N^2], shape (blocks,)."""
    history: Floats
    """Means over all stored blocks, shape (stored, 4), with the columns of `RecentBlocks.blocks`.

    The array is empty if no estimator has the Hunt-Crossley model.
    """
    positions: NDArray[np.intp]
    """Number of rows of `history` up to and including each block, shape (blocks,)."""


def block_sums(
    block: float,
    span: float,
    total: float,
    dt: Sequence[float],
    is_open: Sequence[bool],
    values: Sequence[float],
    spans: list[float],
    totals: list[float],
) -> None:
    """Compute, at each sample, the time since its block began and the integral of a signal.

    A block ends when it is at least `block` seconds long, or when the contact gate closes (there is
    no contact or no motion).

    Parameters
    ----------
    block
        Shortest length of a block [s].
    span, total
        Length [s] of the unfinished block before the first sample, and integral over this block.
    dt, is_open, values
        Time since the previous sample [s], whether the gate is open, and the signal, each for n
        samples.
    spans, totals
        Results: time since the block began [s], and integral of the signal over this time, each for
        n samples. The function writes into these lists.
    """
    for n in range(len(dt)):
        if is_open[n]:
            total += values[n] * dt[n]
            span += dt[n]
        else:
            span = 0.0
            total = 0.0
        spans[n] = span
        totals[n] = total
        if span >= block:
            span = 0.0
            total = 0.0
