"""What a run comes to: each estimator's averages and errors, and the loop's timing."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from estimation import (
    Estimates,
    Estimator,
    estimated_force,
    force_error,
    predicted_force,
    rise_time,
)
from estimation.compiled import Floats


class EstimatorSummary(NamedTuple):
    """One estimator over a trial."""

    b: float
    """Average damping [N s/m]."""
    k: float
    """Average stiffness [N/m]."""
    e_f: float
    """Average force error [N]."""
    one_step_rms: float
    """Root mean square of the one-step prediction's force error [N]."""
    rise_time_s: float
    """Rise time of the stiffness [s], NaN if it never rises."""
    note: str | None
    """What to know of how the estimate came about."""


def summarise(
    t: Floats, x: Floats, v: Floats, f: Floats, estimates: Estimates, estimator: Estimator
) -> EstimatorSummary:
    """Averages and errors of one estimator over the samples that it was given."""
    one_step = f - predicted_force(x, v, estimates)
    return EstimatorSummary(
        b=float(np.mean(estimates.b)),
        k=float(np.mean(estimates.k)),
        e_f=force_error(f, estimated_force(x, v, estimates)),
        one_step_rms=float(np.sqrt(np.mean(one_step**2))),
        rise_time_s=rise_time(t, estimates.k),
        note=estimator.note(estimates),
    )


def loop_timing(rate: float, t: Floats, lateness: Floats, overruns: Floats) -> dict[str, Any]:
    """Rate and lateness of a loop that ran at a nominal `rate` [Hz].

    Parameters
    ----------
    rate
        Nominal rate [Hz].
    t, lateness, overruns
        Time and lateness [s] of each tick, and whether it came upon an overrun.
    """
    percentiles = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
    span = float(t[-1] - t[0]) if len(t) > 1 else math.nan
    return {
        "rate_hz": rate,
        "mean_rate_hz": (len(t) - 1) / span if len(t) > 1 else math.nan,
        "lateness_us": {
            name: float(np.percentile(lateness, q)) * 1e6 if len(t) else math.nan
            for name, q in percentiles.items()
        },
        "overruns": int(overruns.sum()),
        "longest_gap_s": float(np.max(np.diff(t), initial=0.0)),
    }
