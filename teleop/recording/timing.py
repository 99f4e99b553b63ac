"""Compute statistics of the timing of the control loop, and percentiles, in blocks of ticks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from teleop.recording.recording import Recording

MOST = 1 << 18
"""Largest number of different values that are stored exactly."""
DIGITS = 12
"""Number of significant binary digits to which the values are rounded if there are more than `MOST`
different values. The relative rounding error is at most 2^-`DIGITS`."""
MERGED = 1 << 16
"""Number of new values after which equal values are merged into one value with its count."""


class Percentiles:
    """Computes percentiles of values that arrive in blocks, with a limited amount of memory.

    The results are equal to those of `numpy.percentile` for all values together. If there are more
    than `MOST` different values, they are first rounded to `DIGITS` significant binary digits.
    """

    def __init__(self) -> None:
        self._values: Floats = np.empty(0)
        self._counts: NDArray[np.int64] = np.empty(0, np.int64)
        self._new: list[Floats] = []
        self._waiting = 0
        self._rounded = False

    def add(self, values: Floats) -> None:
        """Add a block of values, shape (n,)."""
        self._new.append(values.copy())
        self._waiting += len(values)
        if self._waiting >= MERGED:
            self._merge()

    def value(self, percentage: float) -> float:
        """Return one percentile (50 for the median); NaN without values, or if a value is NaN."""
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
        """Keep each different value once, with its count; round them if they are too many."""
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


PERCENTILES = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
"""Computed percentiles [%], by name."""
HISTOGRAM = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0)
"""Upper bounds of the bins of the histogram of lateness [us]; the last bin has no upper bound."""
PARTS = ("read_time", "compute_time", "write_time", "busy_time")
"""Columns with the durations of the parts of a tick, and of the whole previous tick."""


class RunningTiming:
    """Statistics of the timing of the control loop, from ticks that are added in blocks."""

    def __init__(self) -> None:
        self._ticks = self._overruns = self._skipped = 0
        self._elapsed = self._longest = 0.0
        self._times = {name: Percentiles() for name in ("lateness", *PARTS)}
        self._histogram = np.zeros(len(HISTOGRAM) + 1, np.int64)

    def add(self, ticks: Recording) -> None:
        """Add a block of successive ticks.

        The time step of the very first tick is not used, because the tick before it is not part of
        the statistics.
        """
        periods = ticks["dt"] if self._ticks else ticks["dt"][1:]
        self._ticks += len(ticks)
        self._elapsed += float(np.sum(periods))
        self._longest = float(np.max(periods, initial=self._longest))
        self._overruns += int(ticks["overrun"].sum())
        self._skipped += int(ticks["skipped"].sum())
        for name, times in self._times.items():
            times.add(ticks[name])
        bounds = (0.0, *HISTOGRAM, math.inf)
        self._histogram += np.histogram(ticks["lateness"] * 1e6, bounds)[0]

    def summary(self, rate: float) -> dict[str, Any]:
        """Return the statistics of all added ticks; `rate` is the nominal rate of the loop [Hz]."""
        periods = self._ticks - 1
        return {
            "rate_hz": rate,
            "mean_rate_hz": 1.0 / (self._elapsed / periods) if periods > 0 else math.nan,
            "lateness_us": self._microseconds("lateness"),
            "overruns": self._overruns,
            "longest_gap_s": self._longest,
            "tick_us": {name.removesuffix("_time"): self._microseconds(name) for name in PARTS},
            "lateness_histogram": {
                "bounds_us": list(HISTOGRAM),
                "ticks": self._histogram.tolist(),
            },
            "skipped": self._skipped,
        }

    def _microseconds(self, name: str) -> dict[str, float]:
        times = self._times[name]
        return {key: times.value(q) * 1e6 for key, q in PERCENTILES.items()}
