"""Fit a Prony series to the force relaxation in a hold (a time in which the position is constant).

    f(t) = f_inf + sum_j f_j exp(-t / tau_j)

The Bayesian information criterion selects one or two exponential terms. The time constants tau_j
are found by a nonlinear search. The forces f_inf and f_j are found by linear least squares. A time
constant that is longer than the hold is not identifiable.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from estimation.arrays import Floats
from estimation.batch_models.fit import Parameter, linear_solution
from estimation.estimator import LEVEL_95
from estimation.robust_error import RobustFit, bayesian_criterion


class Relaxation(NamedTuple):
    """A Prony series, a sum of decaying exponentials, that was fitted to the force in a hold.

    In a hold, the position is constant. The series is f_inf + sum_j f_j exp(-t / tau_j).
    """

    parameters: dict[str, Parameter]
    """`f_inf`, `f1` and `tau1`; also `f2` and `tau2` if there is a second exponential term."""
    rms: float
    """Root mean square of the residual [N]."""


def fit_prony(t: Floats, f: Floats) -> Relaxation | None:
    """Fit a Prony series to the force in a hold (a time in which the position is constant).

    The result is None if the force does not relax, or if there are fewer than 10 samples.

    The series is f_inf + sum_j f_j exp(-t / tau_j), with one or two exponential terms.

    t [s] is the time since the start of the hold, and f [N] the force, each of shape (n,). The
    noise of successive samples must be independent.
    """
    best: Relaxation | None = None
    best_bic = bayesian_criterion(f - f.mean(), 1)
    for terms in (1, 2):
        if len(t) < 4 * terms + 6:
            break
        found, residual = fit_terms(t, f, terms)
        bic = bayesian_criterion(residual, 1 + 2 * terms)
        if bic < best_bic - 6.0:
            best, best_bic = found, bic
    return best


def fit_terms(t: Floats, f: Floats, terms: int) -> tuple[Relaxation, Floats]:
    """Fit a Prony series with a given number of exponential terms to the force in a hold.

    The series is f_inf + sum_j f_j exp(-t / tau_j).

    The result also contains the residual, the measured force minus the fitted force [N].
    """
    seconds = float(t[-1] - t[0])
    shortest = 2.0 * float(t[1] - t[0])

    def columns(log_times: Floats) -> Floats:
        decays = np.exp(-np.outer(t, np.exp(-log_times)))
        return np.column_stack([np.ones(len(t)), decays])

    def residual(log_times: Floats) -> Floats:
        regressors = columns(log_times)
        return np.asarray(f - regressors @ linear_solution(regressors, f))

    start = np.log(seconds / np.array([4.0, 30.0])[:terms])
    bounds = (math.log(0.5 * shortest), math.log(10.0 * seconds))
    start = np.clip(start, bounds[0] + 1e-3, bounds[1] - 1e-3)
    solution = least_squares(residual, start, bounds=bounds)
    log_times = np.sort(solution.x)[::-1]
    regressors = columns(log_times)
    theta = linear_solution(regressors, f)
    times = np.exp(log_times)
    slopes = [c * t / tau**2 * np.exp(-t / tau) for c, tau in zip(theta[1:], times, strict=True)]
    jacobian = np.column_stack([regressors, *slopes])
    left = f - regressors @ theta
    fit = RobustFit(theta, left, np.linalg.pinv(jacobian, rcond=1e-10), jacobian)
    values = [*theta.tolist(), *times.tolist()]
    names = ["f_inf", *(f"f{j + 1}" for j in range(terms)), *(f"tau{j + 1}" for j in range(terms))]
    parameters = {}
    for i, (name, value) in enumerate(zip(names, values, strict=True)):
        half = LEVEL_95 * fit.deviation(np.eye(len(values))[i])
        known = half < abs(value)
        if name.startswith("tau"):
            known = known and shortest < value < seconds
        unit = "s" if name.startswith("tau") else "N"
        parameters[name] = Parameter(value, value - half, value + half, unit, known)
    return Relaxation(parameters, float(np.sqrt(np.mean(left**2)))), left
