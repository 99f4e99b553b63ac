"""Summarise the estimates of a record: averages, errors, and the values after the last sample."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.compiled import Floats
from estimation.conditioning import Regression
from estimation.estimator import LEVEL_95, UNKNOWN, Estimates, Estimator
from estimation.metrics import estimated_force, force_error, predicted_force, rise_time


class EstimatorSummary(NamedTuple):
    """Summary of one estimator over a record.

    `b`, `k`, `e_f` and `one_step_rms` do not include the samples before the first estimate. If no
    sample changed the estimate, all estimates and errors are NaN, and there is no note.
    """

    b: float
    """Average damping [N s/m]."""
    k: float
    """Average stiffness [N/m]."""
    e_f: float
    """Average force error [N]."""
    one_step_rms: float
    """Root mean square of the force error of the one-step prediction [N]."""
    rise_time_s: float
    """Rise time of the estimated stiffness [s], see `rise_time`; NaN if it is not defined."""
    b_end: float
    """Damping at the end [N s/m]."""
    k_end: float
    """Stiffness at the end [N/m]."""
    b_interval: float
    """Half width of the 95 % confidence interval of `b_end` [N s/m]; NaN if there is no
    interval."""
    k_interval: float
    """Half width of the 95 % confidence interval of `k_end` [N/m]; NaN if there is no interval."""
    held: float
    """Fraction of the samples that did not change the estimate."""
    further: dict[str, float]
    """Values of the model's parameters besides b and k at the end, by name."""
    further_interval: dict[str, float]
    """Half widths of the 95 % confidence intervals of `further`, by name; NaN if there is no
    interval."""
    further_unit: dict[str, str]
    """Units of the values in `further`, by name."""
    misfit: float
    """Misfit at the end (`estimation.misfit`); NaN if it is not known."""
    note: str | None
    """Warning about the estimates, see `Estimator.note`; None if there is no warning."""


def summarise(
    t: Floats,
    regression: Regression,
    estimates: Estimates,
    estimator: Estimator,
    misfit: Floats,
) -> EstimatorSummary:
    """Return the summary of one estimator.

    The averages do not include the samples at the start that did not change the initial value of
    the estimate.

    Parameters
    ----------
    t
        Time of each sample [s], shape (n,); n may be 0.
    regression
        The n samples that the estimator processed.
    estimates
        The estimates after each sample.
    estimator
        The estimator, in its state after the last sample.
    misfit
        Its misfit after each sample, shape (n,).
    """
    f = regression.f
    one_step = f - predicted_force(regression, estimates)
    known = ~np.logical_and.accumulate(estimates.held)
    some = bool(known.any())
    fitted = estimated_force(regression, estimates)
    units = dict(zip(estimator.names, estimator.units, strict=True))
    return EstimatorSummary(
        b=float(np.mean(estimates.b[known])) if some else math.nan,
        k=float(np.mean(estimates.k[known])) if some else math.nan,
        e_f=force_error(f[known], fitted[known]) if some else math.nan,
        one_step_rms=float(np.sqrt(np.mean(one_step[known] ** 2))) if some else math.nan,
        rise_time_s=rise_time(t, estimates.k),
        b_end=float(estimates.b[-1]) if some else math.nan,
        k_end=float(estimates.k[-1]) if some else math.nan,
        b_interval=interval_at_end(estimates, estimates.b_std),
        k_interval=interval_at_end(estimates, estimates.k_std),
        held=float(np.mean(estimates.held)) if len(t) else 1.0,
        further={
            name: float(series.value[-1]) if some else math.nan
            for name, series in estimates.further.items()
        },
        further_interval={
            name: interval_at_end(estimates, series.std)
            for name, series in estimates.further.items()
        },
        further_unit={name: units[name] for name in estimates.further},
        misfit=float(misfit[-1]) if some else math.nan,
        note=estimator.note(estimates) if some else None,
    )


def interval_at_end(estimates: Estimates, std: Floats) -> float:
    """Return the half width of the 95 % confidence interval after the last sample.

    `std` contains the standard deviations of one parameter, shape (n,). The result is NaN if no
    sample changed the estimate, or if the last standard deviation is NaN or at least `UNKNOWN`.
    """
    known = not estimates.held.all() and std[-1] < UNKNOWN
    return LEVEL_95 * float(std[-1]) if known else math.nan
