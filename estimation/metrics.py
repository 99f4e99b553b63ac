"""Compute performance metrics of the estimates in a trial, for example force error and coverage."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from estimation.arrays import Floats
from estimation.conditioning import Regression
from estimation.estimator import LEVEL_95, UNKNOWN, Estimates
from estimation.model import SIZES

MOST_EXTREMES = 1 << 15
"""Largest number of samples that `RisingValue` stores in each of its two arrays.

If there are more, every second stored sample is discarded.
"""
ACTIVE_STATE = "p"
"""Name of the disturbance force [N] that the active observer estimates besides the parameters."""


def estimated_force(regression: Regression, estimates: Estimates) -> Floats:
    """Return the estimated force f_hat = phi' theta_hat [N], equation (5) of the paper, shape (n,).

    phi contains the regressors of a sample, and theta_hat is the estimate after the same sample.
    """
    return _force(regression, estimates, lambda of: of(estimates))


def predicted_force(
    regression: Regression, estimates: Estimates, before: Estimates | None = None
) -> Floats:
    """Predict the force of each sample with the estimate after the previous sample [N], shape (n,).

    If an estimator follows the noise, the error of this prediction is large. The error of the
    function `estimated_force` is then small, because its estimate already includes the same sample.
    So the prediction is the better test of an estimator.

    Parameters
    ----------
    regression
        The n samples.
    estimates
        The estimates after each sample.
    before
        Estimates after earlier samples. The last of them predicts the force of the first sample.
        None: there are no earlier samples, and the predicted force of the first sample is zero.
    """

    def delayed(of: Callable[[Estimates], Floats]) -> Floats:
        first = of(before)[-1:] if before else np.zeros(1)
        return np.concatenate((first, of(estimates)[:-1]))

    return _force(regression, estimates, delayed)


def _force(
    regression: Regression,
    estimates: Estimates,
    at_samples: Callable[[Callable[[Estimates], Floats]], Floats],
) -> Floats:
    """Return the force of the model, phi' theta [N], shape (n,).

    `at_samples` selects the estimate for each sample, for example the one after the previous
    sample. It is called once per parameter, with a function that reads all values of this
    parameter.
    """
    force: Floats = at_samples(lambda e: e.b) * regression.v
    force = force + at_samples(lambda e: e.k) * regression.x
    if ACTIVE_STATE in estimates.further:
        force += at_samples(lambda e: e.further[ACTIVE_STATE].value)
    columns = [name for name in estimates.further if name in SIZES]
    for name, regressor in zip(columns, regression.further.T, strict=False):
        force += at_samples(lambda e: e.further[name].value) * regressor  # noqa: B023
    return force


def force_error(f: ArrayLike, f_hat: ArrayLike) -> float:
    """Return the average force error e_f [N], the mean of |f - f_hat| over the trial.

    The paper defines e_f = sum |f_k - f_hat_k| / nT, and its values of e_f are in newtons. So this
    function uses the number of samples as nT. The result is about as large as the force noise, as
    in Table I of the paper. If nT were the duration of the trial (n samples, with the sample period
    T = 1 ms), the result would be 1000 times larger, in N/s.

    Parameters
    ----------
    f, f_hat
        Measured force and estimated force [N], each of shape (n,).
    """
    return float(np.mean(np.abs(np.asarray(f) - np.asarray(f_hat))))


def coverage(values: ArrayLike, std: ArrayLike, truth: ArrayLike) -> float:
    """Return the fraction of samples whose 95 % confidence interval contains the true value.

    A sample is not counted if its standard deviation is NaN (the estimator does not compute it), or
    is `UNKNOWN` or more (the data do not determine the parameter). The result is NaN if no sample
    is counted.

    Parameters
    ----------
    values, std
        Estimates of a parameter, and standard deviations of the estimates, each of shape (n,).
    truth
        True value of the parameter, of shape (n,), or one number for all.
    """
    inside, intervals = count_intervals(values, std, truth)
    return inside / intervals if intervals else math.nan


def count_intervals(values: ArrayLike, std: ArrayLike, truth: ArrayLike) -> tuple[int, int]:
    """Count the 95 % confidence intervals that contain the true value, and all intervals.

    There is one interval for each sample whose standard deviation is less than `UNKNOWN`. In other
    samples the data do not determine the parameter, or the standard deviation is not computed.

    The result is the number of intervals that contain the true value, and the number of all
    intervals.
    """
    values, std = np.asarray(values), np.asarray(std)
    determined = std < UNKNOWN
    errors = np.abs(values - np.broadcast_to(np.asarray(truth), values.shape))
    inside = errors[determined] <= LEVEL_95 * std[determined]
    return int(np.sum(inside)), int(np.sum(determined))


def rise_time(t: ArrayLike, estimate: ArrayLike) -> float:
    """Return the rise time t_90 - t_10 [s] of an estimate that starts at zero.

    t_10 is the first time at which the estimate reaches 10 % of its average over the trial. t_90 is
    the first time after t_10 at which the estimate reaches 90 % of this average. The result is NaN
    if the estimate does not reach 90 %, or if the average is zero. A rest before the motion is
    not part of the rise time, because the estimate is zero during this rest.

    Parameters
    ----------
    t, estimate
        Time [s] and estimate, each of shape (n,).
    """
    rising = RisingValue()
    rising.add(np.asarray(t, dtype=np.float64), np.asarray(estimate, dtype=np.float64))
    return rising.time


class RisingValue:
    """Computes the rise time of an estimate whose samples are processed in several parts.

    The rise time is t_90 - t_10, the time from 10 % to 90 % of the average (`rise_time`). The
    average is known only after the last sample, so samples must be stored. A positive level is
    reached for the first time at a sample that is larger than all earlier samples. A negative level
    is reached for the first time at a sample that is smaller than all earlier samples. Only samples
    of these two kinds are stored.
    """

    def __init__(self) -> None:
        self._count, self._sum = 0, 0.0
        self._extremes = [np.empty((2, 0)), np.empty((2, 0))]

    def add(self, t: Floats, estimate: Floats) -> None:
        """Process the next n samples: their times [s] and the estimates, each of shape (n,)."""
        self._count += len(t)
        self._sum += float(np.sum(estimate))
        for i, sign in enumerate((1.0, -1.0)):
            stored = self._extremes[i]
            before = stored[1, -1] if stored.size else -np.inf
            highest = np.fmax.accumulate(np.concatenate(([before], sign * estimate)))
            new = highest[1:] > highest[:-1]
            stored = np.concatenate([stored, [t[new], sign * estimate[new]]], axis=1)
            if stored.shape[1] > MOST_EXTREMES:
                stored = np.concatenate([stored[:, :-1:2], stored[:, -1:]], axis=1)
            self._extremes[i] = stored

    @property
    def time(self) -> float:
        """Rise time [s] for all samples so far; NaN if the estimate does not reach 90 %.

        The rise time is also NaN if the average is zero or if there are no samples.
        """
        average = self._sum / self._count if self._count else 0.0
        if average == 0.0:
            return math.nan
        t, value = self._extremes[0 if average > 0.0 else 1]
        share = value / abs(average)
        if not (len(share) and share[-1] >= 0.9):
            return math.nan
        first, last = (int(np.argmax(share >= level)) for level in (0.1, 0.9))
        return float(t[last] - t[first])
