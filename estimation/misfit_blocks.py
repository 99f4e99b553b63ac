"""Sums over blocks of samples. The misfit is computed from these sums (`estimation.misfit`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats


class BlockEnds(NamedTuple):
    """Data at the ends of blocks of samples. `Misfit.series` computes the misfits from them."""

    at: NDArray[np.intp]
    """Index of the last sample of each block that has a block before it, shape (blocks,)."""
    samples: int
    """Number of samples."""
    products: Floats
    """Weighted mean products of successive block means, shape (blocks, size, size)."""
    square: Floats
    """Weighted mean square of the force [N^2], shape (blocks,)."""
    history: Floats
    """Blocks of `RecentBlocks`, shape (stored, 4); empty without the model of Hunt and Crossley."""
    positions: NDArray[np.intp]
    """Number of blocks in `history` up to the end of each block, shape (blocks,)."""


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
    """Compute, at each sample, the time since the block began and the integral of the values."""
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
