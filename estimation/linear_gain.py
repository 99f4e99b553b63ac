"""Intervals of all estimators of the form theta <- theta + L (f - phi' theta).

The gain L of such an estimator depends on the regressors, not on the noise. Let the true
parameters be theta_0, and let the force have white noise of variance s. Then the error e of the
estimate follows e <- (I - L phi') e + L noise, and its covariance is

    s C,    C <- (I - L phi') C (I - L phi')' + L L'.                                   (C)

This is valid for every choice of the gain: forgetting, a bounded trace, a gradient. The Riccati
covariance P is valid for one method under its own assumptions; C is valid for all (P. S. Maybeck,
"Stochastic Models, Estimation, and Control", vol. 1, 1979, section 6.8, performance of a filter
with any gain).

The force error then has the variance s (1 + phi' C phi), from which s is estimated. Errors
dominated by the initial guess, or with a gain near zero, get proportionally less weight in this
estimate. If the noise is correlated, so that only one of `correlation` samples is independent,
the covariance is multiplied by `correlation`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from estimation.checks import check_correlation
from estimation.compiled import Floats
from estimation.estimator import Estimator
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, State, Vector, below, diagonal, zeros

DIFFUSE = 1e4
"""Variance of the initial guess of a parameter, in units of the method's initial variance.

Before the first sample the noise is unknown, and a standard deviation of 1 N is assumed.
"""
NOISE_MEMORY = 1.0
"""Time constant [s] of the estimate of the noise variance."""
CORRELATED = 1.0 - 1e-12
"""Largest correlation of two parameters; rounding errors may give more."""
LEAST = 1e-100
"""Weight below which a sample does not change the noise variance."""


@dataclass(frozen=True, slots=True)
class LinearGainParameters:
    """Parameters of `correct`."""

    correlation: float
    """Samples per independent noise sample, >= 1."""


@dataclass(slots=True)
class LinearGainState(State):
    """State that `correct` updates."""

    L: Vector
    """Gain, (m,). The method computes it before it calls `correct`."""
    C: Matrix
    """Covariance of theta for a noise variance of 1, (m, m)."""
    C_phi: Vector
    """C phi, (m,)."""
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
    """Update theta by L (f - phi' theta), C by (C), and the standard deviations sqrt(s C_ii)."""
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
        # (I - L phi') C (I - L phi')' is not negative, except for rounding errors
        variance = row[i] + move * (change - covariance)
        least = move * move
        if variance < least:
            variance = least
        row[i] = variance
        std[i] = sqrt(noise * variance)


def update_noise(
    state: LinearGainState, error: float, spread: float, gain: float, dt: float
) -> None:
    """Update the noise variance: the mean of error^2 / spread, with the weights gain / spread.

    `gain` is phi' L and `spread` is 1 + phi' C phi. Weights decay with the time constant
    `NOISE_MEMORY`. A long `dt` before a sample does not increase its weight, because it is still
    one error.
    """
    certainty = 1.0 / spread
    weight = gain * certainty
    kept = 1.0 - dt / NOISE_MEMORY
    evidence = weight + (kept * state.evidence if kept > 0.0 else 0.0)
    state.evidence = evidence
    state.noise += weight / evidence * (error * error * certainty - state.noise)


def linear_gain_state(guess_variance: Sequence[float]) -> dict[str, Any]:
    """Return the fields of the initial `LinearGainState`, by name."""
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
    """Base class of estimators theta <- theta + L (f - phi' theta), whose step ends in `correct`.

    The classes of its parameters and of its state are `LinearGainParameters` and
    `LinearGainState`, or derived from these.

    Parameters
    ----------
    parameters, initial_state, model
        As in `Estimator`. The field `correlation` of the parameters is the number of samples per
        independent noise sample. It is 1 for white force noise, and r / 2B for noise after a
        filter of bandwidth B that is sampled at the rate r.

    Raises
    ------
    ValueError
        The correlation is below 1.
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
        """Compute the gain L, store it in the state, and call `correct`."""

    @property
    def covariance(self) -> Floats:
        """Covariance of the estimate for constant parameters, shape (m, m)."""
        C = np.array(self.state.C)
        deviations = np.sqrt(np.diag(C))
        most = CORRELATED * np.outer(deviations, deviations)
        np.fill_diagonal(most, np.diag(C))
        noise = self.state.noise * self.parameters.correlation
        return np.asarray(noise * np.clip(C, -most, most))
