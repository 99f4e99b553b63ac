"""Compute statistics of the timing of the control loop from the columns of a recording."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from estimation.compiled import Floats
from teleop.recording.recording import Recording

PERCENTILES = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
"""Computed percentiles [%], by name."""
HISTOGRAM = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0)
"""Upper bounds of the bins of the histogram of lateness [us]; the last bin has no upper bound."""


def loop_timing(rate: float, dt: Floats, lateness: Floats, overruns: Floats) -> dict[str, Any]:
    """Return statistics of the rate, the lateness and the overruns of the loop.

    Parameters
    ----------
    rate
        Nominal rate of the loop [Hz].
    dt
        Time since the previous tick [s], shape (ticks,). The first value is not used.
    lateness
        Time from the deadline of a tick to its start [s], shape (ticks,).
    overruns
        1 if the previous tick had not ended at the deadline, otherwise 0, shape (ticks,).
    """
    periods = dt[1:]
    return {
        "rate_hz": rate,
        "mean_rate_hz": 1.0 / float(np.mean(periods)) if len(periods) else math.nan,
        "lateness_us": {
            name: float(np.percentile(lateness, q)) * 1e6 if len(lateness) else math.nan
            for name, q in PERCENTILES.items()
        },
        "overruns": int(overruns.sum()),
        "longest_gap_s": float(np.max(periods, initial=0.0)),
    }


def tick_times(recording: Recording) -> dict[str, Any]:
    """Return percentiles of the durations of the parts of a tick, and a histogram of lateness.

    All times in the result are in us. `HISTOGRAM` gives the bounds of the bins.
    """
    parts = ("read_time", "compute_time", "write_time", "busy_time")
    counts, _ = np.histogram(recording["lateness"] * 1e6, (0.0, *HISTOGRAM, math.inf))
    return {
        "tick_us": {
            name.removesuffix("_time"): {
                key: float(np.percentile(recording[name], q)) * 1e6 if len(recording) else math.nan
                for key, q in PERCENTILES.items()
            }
            for name in parts
        },
        "lateness_histogram": {"bounds_us": list(HISTOGRAM), "ticks": counts.tolist()},
        "skipped": int(recording["skipped"].sum()),
    }
