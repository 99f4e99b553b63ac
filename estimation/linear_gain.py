"""Compute confidence intervals for estimators of the form theta <- theta + L (f - phi' theta).

theta is the estimate, phi are the regressors, f is the force, and L is the gain. The gain depends
on the regressors, not on the noise. Let theta_0 be the true parameters, and let the force have
white noise with the variance s. Then the error e = theta - theta_0 changes at each sample by
e <- (I - L phi') e + L noise. The covariance of e is

    s C,    C <- (I - L phi') C (I - L phi')' + L L'.                                   (C)

Equation (C) is valid for every gain, for example in methods with forgetting and in gradient
methods. A method such as recursive least squares also has its own covariance matrix P. But P is the
covariance of e only if the assumptions of the method are valid. s C is the covariance of e for all
methods (P. S. Maybeck, "Stochastic Models, Estimation, and Control", vol. 1, 1979, section 6.8,
performance of a filter with any gain).

The variance s is estimated from the force errors f - phi' theta, because their variance is
s (1 + phi' C phi). In this estimate, a force error has little weight while the error of the initial
guess is large, or if the gain is near zero. If the noise is correlated, n samples contain only
n / `correlation` independent values of the noise. The covariance is then multiplied by
`correlation`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from estimation.arrays import Floats
from estimation.checks import check_correlation
from estimation.estimator import Estimator
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, State, Vector, below, diagonal, zeros

DIFFUSE = 1e4
"""Initial variance of a parameter in C, divided by its `guess_variance` (`linear_gain_state`).

Before the first sample the noise variance s is unknown. The standard deviations are then computed
with s = 1 N^2.
"""
NOISE_MEMORY = 1.0
"""Time constant [s] of the estimate of the noise variance."""
CORRELATED = 1.0 - 1e-12
"""Upper limit of the correlation coefficient of two parameters.

Without this limit, rounding errors could cause a coefficient above 1.
"""
LEAST = 1e-100
"""A sample with a smaller weight than this does not change the noise variance."""


@dataclass(frozen=True, slots=True)
class LinearGainParameters:
    """Constant settings of an estimator of the form theta <- theta + L (f - phi' theta).

    The function `correct` reads these settings.
    """

    correlation: float
    """Correlation length of the force noise, in samples, >= 1; 1 for white noise."""


@dataclass(slots=True)
class LinearGainState(State):
    """State of an estimator of the form theta <- theta + L (f - phi' theta).

    The function `correct` updates this state at each sample. m is the number of parameters.
    """

    L: Vector
    """Gain, (m,). The step of a method computes this gain before it calls `correct`."""
    C: Matrix
    """Covariance of theta for a noise variance of 1, (m, m)."""
    C_phi: Vector
    """Product C phi for the latest sample, (m,)."""
    noise: float
    """Variance s of the noise [N^2]."""
    evidence: float
    """Sum of the weights of the samples from which `noise` is estimated."""


def correct(
    parameters: LinearGainParameters,
    state: LinearGainState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Update the estimate theta and its standard deviations with one sample.

    theta changes by L (f - phi' theta). The gain L is in the state and must be computed before. The
    matrix C changes by equation (C) of this module, and the noise variance s by `update_noise`. The
    standard deviation of parameter i is sqrt(c s C_ii). c is the setting `correlation`, which is
    the correlation length of the force noise, in samples.
    """
    theta, std, L, C, C_phi = state.theta, state.std, state.L, state.C, state.C_phi
    indices = below[len(phi)]
    error = f
    spread = 1.0
    gain = 0.0
    for i in indices:
        row = C[i]
        total = 0.0
        for j in indices:
            total += row[j] * phi[j]
        C_phi[i] = total
        regressor = phi[i]
        error -= regressor * theta[i]
        spread += regressor * total
        gain += regressor * L[i]
    if spread < 1.0:  # rounding error
        spread = 1.0
    if gain > LEAST * spread:
        update_noise(state, error, spread, gain, dt)
    noise = parameters.correlation * state.noise
    for i in indices:
        move = L[i]
        row = C[i]
        theta[i] += move * error
        covariance = C_phi[i]
        change = spread * move - covariance
        for j in below[i]:
            row[j] = C[j][i] = row[j] - move * C_phi[j] + change * L[j]
        # in exact arithmetic, (I - L phi') C (I - L phi')' has no negative diagonal element
        variance = row[i] + move * (change - covariance)
        least = move * move
        if variance < least:
            variance = least
        row[i] = variance
        std[i] = sqrt(noise * variance)


def update_noise(
    state: LinearGainState, error: float, spread: float, gain: float, dt: float
) -> None:
    """Update the estimated variance s of the force noise with a new sample.

    s is a weighted mean of error^2 / spread over the past samples. The weight of the new sample is
    gain / spread. The weights of the earlier samples decay with a time constant of 1 s.

    `error` is f - phi' theta [N], `spread` is 1 + phi' C phi, and `gain` is phi' L.
    """
    certainty = 1.0 / spread
    weight = gain * certainty
    kept = 1.0 - dt / NOISE_MEMORY
    evidence = weight + (kept * state.evidence if kept > 0.0 else 0.0)
    state.evidence = evidence
    state.noise += weight / evidence * (error * error * certainty - state.noise)


def linear_gain_state(guess_variance: Sequence[float]) -> dict[str, Any]:
    """Return the initial values of the fields of `LinearGainState`, by the name of the field.

    The initial guess of all parameters is 0. `guess_variance` contains, for each parameter, the
    variance of the error of this guess, for force noise with a variance of 1 N^2. The initial C is
    a diagonal matrix of `DIFFUSE` times these variances.
    """
    m = len(guess_variance)
    variances = [DIFFUSE * variance for variance in guess_variance]
    return {
        "theta": zeros(m),
        "std": [sqrt(variance) for variance in variances],
        "held": False,
        "L": zeros(m),
        "C": diagonal(variances),
        "C_phi": zeros(m),
        "noise": 0.0,
        "evidence": 0.0,
    }


class LinearGainEstimator(Estimator):
    """Base class of estimators of the form theta <- theta + L (f - phi' theta).

    theta is the estimate, phi are the regressors, f is the force, and L is the gain. The function
    `step` of such an estimator computes L and then calls `correct`.

    Parameters
    ----------
    parameters
        Constant settings, a `LinearGainParameters` or a subclass. The field `correlation` is the
        correlation length of the force noise, in samples: n samples contain n / correlation
        independent values of the noise. For white noise, `correlation` is 1. For noise that
        passed a low-pass filter with the noise bandwidth B [Hz] and was then sampled at the rate r
        [Hz], `correlation` is r / (2 B).
    initial_state
        State before the first sample, a `LinearGainState` or a subclass.
    model
        Model that defines the regressors.

    Raises
    ------
    ValueError
        `correlation` is below 1.
    """

    parameters: LinearGainParameters
    state: LinearGainState

    def __init__(
        self,
        parameters: LinearGainParameters,
        initial_state: LinearGainState,
        model: Model = KELVIN_VOIGT,
    ) -> None:
        check_correlation(parameters.correlation)
        super().__init__(parameters, initial_state, model)

    @staticmethod
    @abstractmethod
    def step(parameters: Any, state: Any, phi: Regressors, f: float, dt: float) -> None:
        """Process one sample: compute the gain L, store it in `state.L`, and call `correct`."""

    @property
    def covariance(self) -> Floats:
        """Covariance matrix of the m estimated parameters, shape (m, m).

        It is valid if the true parameters are constant.
        """
        C = np.array(self.state.C)
        deviations = np.sqrt(np.diag(C))
        most = CORRELATED * np.outer(deviations, deviations)
        np.fill_diagonal(most, np.diag(C))
        noise = self.state.noise * self.parameters.correlation
        return np.asarray(noise * np.clip(C, -most, most))
