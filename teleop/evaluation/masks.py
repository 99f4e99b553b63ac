"""Compute masks over samples: thresholds with hysteresis, and runs of true values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats


def hysteresis(values: Floats, low: float, high: float) -> NDArray[np.bool_]:
    """Return a mask that becomes True above `high` and False below `low`, shape (n,).

    Between `low` and `high`, the mask keeps its previous value.
    """
    state = np.where(values > high, 1, np.where(values < low, 0, -1))
    known = np.flatnonzero(state >= 0)
    if not len(known):
        return np.zeros(len(values), dtype=np.bool_)
    last = np.searchsorted(known, np.arange(len(values)), side="right") - 1
    return np.asarray(state[known[np.maximum(last, 0)]] == 1)


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first index, and the index after the last, of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def without_short(mask: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    """Return the mask with runs of fewer than `shortest` true values set to False."""
    kept = mask.copy()
    for start, end in runs(mask):
        if end - start < shortest:
            kept[start:end] = False
    return kept


def eroded(mask: NDArray[np.bool_], guard: int) -> NDArray[np.bool_]:
    """Return the mask with the first and last `guard` samples of each run of True set to False.

    A run that starts at the first sample of the record keeps its first samples. A run that ends at
    the last sample of the record keeps its last samples.
    """
    kept = mask.copy()
    for start, end in runs(mask):
        if start > 0:
            kept[start : start + guard] = False
        if end < len(mask):
            kept[max(end - guard, 0) : end] = False
    return kept
