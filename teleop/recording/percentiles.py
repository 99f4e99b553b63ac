"""Compute percentiles of values that arrive in blocks, with a limited amount of memory."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats

MOST = 1 << 18
"""Largest number of different values that are stored exactly."""
DIGITS = 12
"""Number of significant binary digits to which the values are rounded if there are more than `MOST`
different values. The relative rounding error is at most 2^-`DIGITS`."""
MERGED = 1 << 16
"""Number of new values after which equal values are merged into one value with its count."""


class Percentiles:
    """Computes percentiles of values that arrive in blocks.

    The results are equal to those of `numpy.percentile` for all values together. If there are more
    than `MOST` different values, the values are first rounded to `DIGITS` significant binary
    digits, to save memory.
    """

    def __init__(self) -> None:
        self._values: Floats = np.empty(0)
        self._counts: NDArray[np.int64] = np.empty(0, np.int64)
        self._new: list[Floats] = []
        self._waiting = 0
        self._rounded = False

    def add(self, values: Floats) -> None:
        """Add a block of n values, shape (n,), from which the percentiles are computed."""
        self._new.append(values.copy())
        self._waiting += len(values)
        if self._waiting >= MERGED:
            self._merge()

    def value(self, percentage: float) -> float:
        """Return one percentile of all added values. A percentage of 50 gives the median.

        `percentage` is between 0 and 100. The result is NaN if there are no values, or if one of
        the values is NaN.
        """
        self._merge()
        if not len(self._values) or math.isnan(self._values[-1]):
            return math.nan
        ends = np.cumsum(self._counts)
        place = (int(ends[-1]) - 1) * (percentage / 100.0)
        below = math.floor(place)
        low, high = self._values[
            np.searchsorted(ends, (below, min(below + 1, ends[-1] - 1)), side="right")
        ].tolist()
        share, step = place - below, high - low
        return float(high - step * (1.0 - share) if share >= 0.5 else low + step * share)

    def _merge(self) -> None:
        """Merge equal values: store each different value once, with its number of occurrences.

        If there are more than `MOST` different values, the values are rounded, and the values that
        have become equal are merged.
        """
        if not self._waiting:
            return
        values = np.concatenate([self._values, *self._new])
        counts = np.concatenate([self._counts, np.ones(self._waiting, np.int64)])
        self._new, self._waiting = [], 0
        if self._rounded:
            values = rounded(values)
        self._count(values, counts)
        if len(self._values) > MOST:
            self._rounded = True
            self._count(rounded(self._values), self._counts)

    def _count(self, values: Floats, counts: NDArray[np.int64]) -> None:
        self._values, places = np.unique(values, return_inverse=True)
        self._counts = np.zeros(len(self._values), np.int64)
        np.add.at(self._counts, places, counts)


def rounded(values: Floats) -> Floats:
    """Return the values, each rounded to `DIGITS` significant binary digits."""
    fraction, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.round(np.ldexp(fraction, DIGITS)), exponent - DIGITS))
