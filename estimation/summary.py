"""Summary of the estimates over a record: averages, errors, and the values at its end."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.compiled import Floats
from estimation.conditioning import Regression
from estimation.estimator import LEVEL_95, UNKNOWN, Estimates, Estimator
from estimation.metrics import estimated_force, force_error, predicted_force, rise_time


class EstimatorSummary(NamedTuple):
    """Summary of one estimator over a record."""

    b: float
    """Average damping [N s/m]."""
    k: float
    """Average stiffness [N/m]."""
    e_f: float
    """Average force error [N]."""
    one_step_rms: float
    """Root mean square of the force error of the one-step prediction [N]."""
    rise_time_s: float
    """Rise time of the stiffness [s]; NaN if it never rises."""
    b_end: float
    """Damping at the end [N s/m]."""
    k_end: float
    """Stiffness at the end [N/m]."""
    b_interval: float
    """Half width of the 95 % interval of the damping at the end [N s/m]; NaN for none."""
    k_interval: float
    """Half width of the 95 % interval of the stiffness at the end [N/m]; NaN for none."""
    held: float
    """Share of the samples at which the estimate was held."""
    further: dict[str, float]
    """Values of the model's further parameters at the end, by name."""
    misfit: float
    """Misfit at the end (`estimation.misfit`); NaN if it is not known."""
    note: str | None
    """Remark that the estimator makes on its estimates; None for none."""


def summarise(
    t: Floats,
    regression: Regression,
    estimates: Estimates,
    estimator: Estimator,
    misfit: Floats,
) -> EstimatorSummary:
    """Return the summary of one estimator.

    Parameters
    ----------
    t
        Time of each sample [s], shape (n,).
    regression
        The n samples that the estimator processed.
    estimates
        The estimates after each sample.
    estimator
        The estimator in its final state.
    misfit
        Its misfit after each sample, shape (n,).
    """
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
        b_interval=interval_at_end(estimates, estimates.b_std),
        k_interval=interval_at_end(estimates, estimates.k_std),
        held=float(np.mean(estimates.held)),
        further={name: float(series.value[-1]) for name, series in estimates.further.items()},
        misfit=float(misfit[-1]),
        note=estimator.note(estimates),
    )


def interval_at_end(estimates: Estimates, std: Floats) -> float:
    """Return half the width of the 95 % interval at the end; NaN if there is no interval."""
    known = not estimates.held.all() and std[-1] < UNKNOWN
    return LEVEL_95 * float(std[-1]) if known else math.nan
