"""Compute performance metrics of the estimates in a trial, for example force error and coverage."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from estimation.compiled import Floats
from estimation.conditioning import Regression
from estimation.estimator import LEVEL_95, UNKNOWN, Estimates
from estimation.model import SIZES

ACTIVE_STATE = "p"
"""Name of the disturbance force [N] that the active observer estimates besides the model."""


def estimated_force(regression: Regression, estimates: Estimates) -> Floats:
    """Return the estimated force f_hat = phi' theta_hat [N], equation (5) of the paper, shape (n,).

    theta_hat is the estimate after the same sample.
    """
    return _force(regression, estimates, lambda series: series)


def predicted_force(regression: Regression, estimates: Estimates) -> Floats:
    """Return the one-step prediction of the force [N], shape (n,). The first value is zero.

    The force of each sample is predicted with the estimate after the previous sample. An estimator
    that follows the noise has a small error of `estimated_force`, but a large error of this
    prediction.
    """
    return _force(regression, estimates, lambda series: np.concatenate(([0.0], series[:-1])))


def _force(
    regression: Regression, estimates: Estimates, of_sample: Callable[[Floats], Floats]
) -> Floats:
    force: Floats = of_sample(estimates.b) * regression.v + of_sample(estimates.k) * regression.x
    if ACTIVE_STATE in estimates.further:
        force += of_sample(estimates.further[ACTIVE_STATE].value)
    columns = [name for name in estimates.further if name in SIZES]
    for name, regressor in zip(columns, regression.further.T, strict=False):
        force += of_sample(estimates.further[name].value) * regressor
    return force


def force_error(f: ArrayLike, f_hat: ArrayLike) -> float:
    """Return the average force error e_f [N], the mean of |f - f_hat| over the trial.

    The paper defines e_f = sum |f_k - f_hat_k| / nT and gives values in newtons. Here nT is the
    number of samples. So e_f is a mean in newtons. It is about as large as the force noise, as in
    Table I of the paper. If T were the sample period of 1 ms, e_f would be in N/s, and 1000 times
    the mean.
    """
    return float(np.mean(np.abs(np.asarray(f) - np.asarray(f_hat))))


def coverage(values: ArrayLike, std: ArrayLike, truth: ArrayLike) -> float:
    """Return the fraction of samples whose 95 % confidence interval contains the true value.

    A sample is not counted if its standard deviation is NaN, or is `UNKNOWN` or more. The result
    is NaN if no sample is counted.

    Parameters
    ----------
    values, std
        Estimates of a parameter, and standard deviations of the estimates, each of shape (n,).
    truth
        True value of the parameter, of shape (n,), or one number for all.
    """
    values, std = np.asarray(values), np.asarray(std)
    determined = std < UNKNOWN
    if not determined.any():
        return float("nan")
    errors = np.abs(values - np.broadcast_to(np.asarray(truth), values.shape))
    return float(np.mean(errors[determined] <= LEVEL_95 * std[determined]))


def rise_time(t: ArrayLike, estimate: ArrayLike) -> float:
    """Return the rise time t_90 - t_10 [s] of an estimate that starts at zero.

    t_10 is the first time at which the estimate reaches 10 % of its average over the trial. t_90 is
    the first time after t_10 at which the estimate reaches 90 % of this average. The result is NaN
    if the estimate does not reach 90 %, or if the average is zero. A rest before the motion does
    not change the rise time, because the estimate is zero during this rest.

    Parameters
    ----------
    t, estimate
        Time [s] and estimate, each of shape (n,).
    """
    t = np.asarray(t, dtype=np.float64)
    share = np.asarray(estimate, dtype=np.float64)
    average = share.mean() if len(share) else 0.0
    if average == 0.0:
        return float("nan")
    share = share / average
    first = int(np.argmax(share >= 0.1))
    last = first + int(np.argmax(share[first:] >= 0.9))
    return float(t[last] - t[first]) if share[last] >= 0.9 else float("nan")
