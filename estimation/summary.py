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
    """Average damping [N s/m] from the first estimate on; so are the next three."""
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
    further_interval: dict[str, float]
    """Half widths of their 95 % intervals; NaN for none."""
    further_unit: dict[str, str]
    """Units of the further parameters, by name."""
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

    Averages leave out the samples at the start at which the estimator holds its initial value.
    They are NaN if it holds it throughout.

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
        b_end=float(estimates.b[-1]),
        k_end=float(estimates.k[-1]),
        b_interval=interval_at_end(estimates, estimates.b_std),
        k_interval=interval_at_end(estimates, estimates.k_std),
        held=float(np.mean(estimates.held)),
        further={name: float(series.value[-1]) for name, series in estimates.further.items()},
        further_interval={
            name: interval_at_end(estimates, series.std)
            for name, series in estimates.further.items()
        },
        further_unit={name: units[name] for name in estimates.further},
        misfit=float(misfit[-1]),
        note=estimator.note(estimates),
    )


def interval_at_end(estimates: Estimates, std: Floats) -> float:
    """Return half the width of the 95 % interval at the end; NaN if there is no interval."""
    known = not estimates.held.all() and std[-1] < UNKNOWN
    return LEVEL_95 * float(std[-1]) if known else math.nan
