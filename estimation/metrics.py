"""How well an estimate does over a trial."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from estimation.compiled import Floats
from estimation.conditioning import Regression
from estimation.estimator import LEVEL_95, UNKNOWN, Estimates
from estimation.model import SIZES

ACTIVE_STATE = "p"
"""Name of the force [N] that the active observer takes up besides the model's."""


def estimated_force(regression: Regression, estimates: Estimates) -> Floats:
    """Force f_hat = phi' theta_hat [N] of each sample by its own estimate, the paper's (5)."""
    return _force(regression, estimates, lambda series: series)


def predicted_force(regression: Regression, estimates: Estimates) -> Floats:
    """Force [N] of each sample by the estimate before it; zero for the first sample.

    The error of this one-step prediction is what an estimator has not yet seen, so unlike
    that of (5) it cannot be made small by following the noise.
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
    """Average force error e_f [N], the mean of |f - f_hat| over the trial.

    The paper prints e_f = sum |f_k - f_hat_k| / nT and a value in newtons. With T the sample
    period that sum is 1000 times the mean and in N/s; with nT read as the number of samples
    it is the mean in newtons, and of the size of the force noise as in Table I.
    """
    return float(np.mean(np.abs(np.asarray(f) - np.asarray(f_hat))))


def coverage(values: ArrayLike, std: ArrayLike, truth: ArrayLike) -> float:
    """Share of the samples whose 95 % interval holds the truth; NaN where there is none.

    Parameters
    ----------
    values, std
        Estimates of a parameter and their standard deviations, each of shape (n,).
    truth
        What the parameter is, of shape (n,), or one number for all.
    """
    values, std = np.asarray(values), np.asarray(std)
    told = std < UNKNOWN
    if not told.any():
        return float("nan")
    off = np.abs(values - np.broadcast_to(np.asarray(truth), values.shape))
    return float(np.mean(off[told] <= LEVEL_95 * std[told]))


def rise_time(t: ArrayLike, estimate: ArrayLike) -> float:
    """Rise time t_90 - t_10 [s] of an estimate that starts from nothing.

    t_10 is the first time at which the estimate passes 10 % of its average over the trial,
    t_90 the first time from then on at which it passes 90 %. NaN if it never does. Time
    before the estimate leaves zero, such as a rest before the motion, does not count.

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
