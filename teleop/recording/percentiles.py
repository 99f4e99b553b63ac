"""Percentiles of values that arrive in blocks, with bounded memory."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats

MOST = 1 << 18
"""Largest number of different values that are stored exactly."""
DIGITS = 12
"""Number of binary digits to which the values are rounded if there are more than `MOST` different
values. The relative rounding error is at most 2^-12, which is 0.024 %."""
MERGED = 1 << 16
"""Number of new values after which equal values are counted together."""


class Percentiles:
    """Percentiles of values that arrive in blocks.

    The percentiles are those of `numpy.percentile`. If there are more than `MOST` different values,
    the values are rounded to `DIGITS` binary digits.
    """

    def __init__(self) -> None:
        self._values: Floats = np.empty(0)
        self._counts: NDArray[np.int64] = np.empty(0, np.int64)
        self._new: list[Floats] = []
        self._waiting = 0
        self._rounded = False

    def add(self, values: Floats) -> None:
        """Add values, shape (n,)."""
        self._new.append(values.copy())
        self._waiting += len(values)
        if self._waiting >= MERGED:
            self._merge()

    def value(self, percentage: float) -> float:
        """Return a percentile of the values, for a percentage of 0 to 100.

        The result is NaN if there are no values, or if one of them is NaN.
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
        """Replace equal values by one value and its count.

        If there are still too many different values, they are rounded, and equal values are counted
        again.
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
    """Return values rounded to `DIGITS` binary digits."""
    fraction, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.round(np.ldexp(fraction, DIGITS)), exponent - DIGITS))
