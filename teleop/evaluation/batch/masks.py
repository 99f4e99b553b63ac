"""Compute masks: arrays of Booleans that select samples.

A run is a sequence of successive samples at which the mask is True.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats


def hysteresis(values: Floats, low: float, high: float) -> NDArray[np.bool_]:
    """Return a mask that becomes True above `high` and False below `low`, shape (n,).

    Between `low` and `high`, the mask keeps its previous value. If the first values are between
    these limits, the mask has there the value that follows. If all values are between them, the
    mask is False.
    """
    state = np.where(values > high, 1, np.where(values < low, 0, -1))
    known = np.flatnonzero(state >= 0)
    if not len(known):
        return np.zeros(len(values), dtype=np.bool_)
    last = np.searchsorted(known, np.arange(len(values)), side="right") - 1
    return np.asarray(state[known[np.maximum(last, 0)]] == 1)


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return start and end of each run: a sequence of successive samples at which the mask is True.

    The start is the index of the first sample of the run. The end is the index of its last sample
    plus 1.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def without_short(mask: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    """Return a copy of the mask in which short runs are False.

    A run is a sequence of successive samples at which the mask is True. It is short if it has fewer
    than `shortest` samples.
    """
    kept = mask.copy()
    for start, end in runs(mask):
        if end - start < shortest:
            kept[start:end] = False
    return kept


def eroded(mask: NDArray[np.bool_], guard: int) -> NDArray[np.bool_]:
    """Return a copy of the mask with the first and last `guard` samples of each run set to False.

    A run is a sequence of successive samples at which the mask is True. If a run starts at the
    first sample of the mask, its first samples are not changed. If a run ends at the last sample of
    the mask, its last samples are not changed.
    """
    kept = mask.copy()
    for start, end in runs(mask):
        if start > 0:
            kept[start : start + guard] = False
        if end < len(mask):
            kept[max(end - guard, 0) : end] = False
    return kept
