"""Compute statistics of the timing of the control loop from the columns of a recording."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from teleop.recording.percentiles import Percentiles
from teleop.recording.recording import Recording

PERCENTILES = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
"""Computed percentiles [%], by name."""
HISTOGRAM = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0)
"""Upper bounds of the bins of the histogram of lateness [us]; the last bin has no upper bound."""
PARTS = ("read_time", "compute_time", "write_time", "busy_time")
"""Columns with the durations of the parts of a tick, and of the whole previous tick."""


class RunningTiming:
    """Statistics of the timing of the control loop, computed from ticks that are added in blocks.

    A tick is one period of the loop. The statistics are: mean rate, lateness (delay of the start of
    a tick), number of overruns (ticks that took too long), and durations of the ticks.
    """

    def __init__(self) -> None:
        self._ticks = self._overruns = self._skipped = 0
        self._elapsed = self._longest = 0.0
        self._times = {name: Percentiles() for name in ("lateness", *PARTS)}
        self._histogram = np.zeros(len(HISTOGRAM) + 1, np.int64)

    def add(self, ticks: Recording) -> None:
        """Add a block of successive ticks to the statistics.

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
        """Return the statistics of all added ticks, as a dictionary.

        Lateness is the time from the deadline of a tick to its start. An overrun is a tick that had
        not ended at the next deadline. The histogram states how many ticks have a lateness in each
        of the intervals that `HISTOGRAM` defines.

        Parameters
        ----------
        rate
            Nominal rate of the loop [Hz], which is copied into the result.
        """
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
