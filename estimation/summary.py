"""Summarise the estimates of a record: averages, errors, and the values after the last sample."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.conditioning import Regression
from estimation.estimator import LEVEL_95, UNKNOWN, Estimates, Estimator
from estimation.metrics import RisingValue, estimated_force, predicted_force


class EstimatorSummary(NamedTuple):
    """Summary of the estimates of one estimator over a record.

    `b`, `k`, `e_f` (average force error) and `one_step_rms` (error of the one-step prediction) do
    not include the samples before the first change of the estimate. If no sample changed the
    estimate, all estimates and errors are NaN, and `note` is None.
    """

    b: float
    """Average damping [N s/m]."""
    k: float
    """Average stiffness [N/m]."""
    e_f: float
    """Average force error [N]: the mean of |f - f_hat|, where f_hat is the estimated force."""
    one_step_rms: float
    """Root mean square of the error of the one-step prediction of the force [N]."""
    rise_time_s: float
    """Rise time of the estimated stiffness [s], see `metrics.rise_time`; NaN if not defined."""
    b_end: float
    """Damping after the last sample [N s/m]."""
    k_end: float
    """Stiffness after the last sample [N/m]."""
    b_interval: float
    """Half width of the 95 % confidence interval of `b_end` [N s/m]; NaN if there is no
    interval."""
    k_interval: float
    """Half width of the 95 % confidence interval of `k_end` [N/m]; NaN if there is no interval."""
    held: float
    """Fraction of the samples that did not change the estimate."""
    further: dict[str, float]
    """Values of the parameters besides b and k after the last sample, by name."""
    further_interval: dict[str, float]
    """Half widths of the 95 % confidence intervals of `further`, by name; NaN if there is no
    interval."""
    further_unit: dict[str, str]
    """Units of the values in `further`, by name."""
    misfit: float
    """Misfit after the last sample; NaN if it is not known. The misfit is the systematic part of
    the force error, relative to the force (`estimation.misfit`)."""
    note: str | None
    """Text about the estimates, for example a warning, see `Estimator.note`; None for no text."""


def summarise(
    t: Floats,
    regression: Regression,
    estimates: Estimates,
    estimator: Estimator,
    misfit: Floats,
) -> EstimatorSummary:
    """Return the summary of the estimates of one estimator.

    The averages do not include the samples before the first change of the estimate.

    `estimator` is in its state after the last sample.
    """
    running = RunningSummary(estimator)
    running.add(t, regression, estimates, misfit)
    return running.summary(estimates)


class RunningSummary:
    """Computes the summary of one estimator over a record that is processed in blocks."""

    def __init__(self, estimator: Estimator) -> None:
        self._estimator = estimator
        self._before: Estimates | None = None
        self._rise = RisingValue()
        self._samples = self._held = self._known = 0
        self._misfit = math.nan
        self._sums = np.zeros(4)

    def add(self, t: Floats, regression: Regression, estimates: Estimates, misfit: Floats) -> None:
        """Process the next block of samples.

        The arguments are those of `summarise`, but contain only the samples of this block.
        """
        if not len(t):
            return
        f = regression.f
        one_step = f - predicted_force(regression, estimates, self._before)
        held = np.logical_and.accumulate(estimates.held)
        known = np.ones(len(f), dtype=np.bool_) if self._known else ~held
        error = np.abs(f[known] - estimated_force(regression, estimates)[known])
        sums = (estimates.b[known], estimates.k[known], error, one_step[known] ** 2)
        self._sums += [np.sum(values) for values in sums]
        self._samples += len(f)
        self._held += int(np.sum(estimates.held))
        self._known += int(np.sum(known))
        self._rise.add(t, estimates.k)
        self._before = estimates.part(slice(-1, None))
        self._misfit = float(misfit[-1])

    def summary(self, estimates: Estimates) -> EstimatorSummary:
        """Return the summary of all blocks that were processed so far.

        `estimates` is used only for `Estimator.note`, which also accepts evenly spaced samples. If
        the arrays are empty, the estimate after the last sample is used.
        """
        estimator, some = self._estimator, self._known > 0
        end = self._before or estimates
        b, k, e_f, square = (self._sums / self._known).tolist() if some else [math.nan] * 4
        units = dict(zip(estimator.names, estimator.units, strict=True))
        return EstimatorSummary(
            b=b,
            k=k,
            e_f=e_f,
            one_step_rms=math.sqrt(square),
            rise_time_s=self._rise.time,
            b_end=float(end.b[-1]) if some else math.nan,
            k_end=float(end.k[-1]) if some else math.nan,
            b_interval=self._interval(end.b_std),
            k_interval=self._interval(end.k_std),
            held=self._held / self._samples if self._samples else 1.0,
            further={
                name: float(series.value[-1]) if some else math.nan
                for name, series in end.further.items()
            },
            further_interval={
                name: self._interval(series.std) for name, series in end.further.items()
            },
            further_unit={name: units[name] for name in end.further},
            misfit=self._misfit if some else math.nan,
            note=estimator.note(estimates if len(estimates.held) else end) if some else None,
        )

    def _interval(self, std: Floats) -> float:
        """Return half the width of a parameter's 95 % confidence interval after the last sample.

        `std` contains the standard deviations of the parameter. Only the last one is used. The
        result is NaN if this standard deviation is NaN, or so large (at least `UNKNOWN`) that the
        data do not determine the parameter. It is also NaN if no sample changed the estimate.
        """
        is_known = self._held < self._samples and std[-1] < UNKNOWN
        return LEVEL_95 * float(std[-1]) if is_known else math.nan
