"""What a run comes to: each estimator's averages and errors, and the loop's timing."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from estimation import (
    Estimates,
    Estimator,
    Regression,
    estimated_force,
    force_error,
    predicted_force,
    rise_time,
)
from estimation.compiled import Floats
from estimation.estimator import LEVEL_95, UNKNOWN
from teleop.recording.recording import Recording
from teleop.safety.soft_limits import ACCELERATION, FORCE, POSITION, VELOCITY

PERCENTILES = {"p50": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
HISTOGRAM = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0)
"""Bounds of the classes of lateness [us]."""


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
    b_end: float
    """Damping at the end [N s/m]."""
    k_end: float
    """Stiffness at the end [N/m]."""
    b_interval: float
    """Half of the 95 % interval of the damping at the end [N s/m]; NaN where none is given."""
    k_interval: float
    """Half of the 95 % interval of the stiffness at the end [N/m]; NaN where none is given."""
    held: float
    """Share of the samples at which the estimate was held."""
    further: dict[str, float]
    """Further parameters at the end."""
    note: str | None
    """What to know of how the estimate came about."""


def summarise(
    t: Floats, regression: Regression, estimates: Estimates, estimator: Estimator
) -> EstimatorSummary:
    """Averages and errors of one estimator over the samples that it was given."""
    f = regression.f
    one_step = f - predicted_force(regression, estimates)
    return EstimatorSummary(
        b=float(np.mean(estimates.b)),
        k=float(np.mean(estimates.k)),
        e_f=force_error(f, estimated_force(regression, estimates)),
        one_step_rms=float(np.sqrt(np.mean(one_step**2))),
        rise_time_s=rise_time(t, estimates.k),
        b_end=float(estimates.b[-1]),
        k_end=float(estimates.k[-1]),
        b_interval=interval(estimates, estimates.b_std),
        k_interval=interval(estimates, estimates.k_std),
        held=float(np.mean(estimates.held)),
        further={name: float(series.value[-1]) for name, series in estimates.further.items()},
        note=estimator.note(estimates),
    )


def interval(estimates: Estimates, std: Floats) -> float:
    """Half of the 95 % interval at the end; NaN where none is given or nothing was learned."""
    known = not estimates.held.all() and std[-1] < UNKNOWN
    return LEVEL_95 * float(std[-1]) if known else math.nan


def loop_timing(rate: float, dt: Floats, lateness: Floats, overruns: Floats) -> dict[str, Any]:
    """Rate and lateness of a loop that ran at a nominal `rate` [Hz].

    Parameters
    ----------
    rate
        Nominal rate [Hz].
    dt, lateness, overruns
        Of each tick the time since the one before and the lateness [s], and whether it came
        upon an overrun. The first tick's `dt` is not measured.
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
    """What the parts of a tick took, all of it, and how late the ticks were [us].

    The histogram counts ticks by lateness, in the classes that `HISTOGRAM` bounds.
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


def safety_summary(active: Recording, fault: dict[str, Any] | None) -> dict[str, Any]:
    """The fault, if any, those after it, and the ticks at which soft limits reduced the command."""
    flags = active["limited"].astype(int)
    names = {"velocity": VELOCITY, "acceleration": ACCELERATION, "position": POSITION}
    held = {
        name: int(((flags & flag) > 0).sum()) for name, flag in (names | {"force": FORCE}).items()
    }
    further = [event["text"] for event in active.events if event["fault"]][1:]
    return {"fault": fault, "further_faults": further, "limited_ticks": held}
