"""What all estimators of the form theta <- theta + L (f - phi' theta) share: their intervals.

The gain L of such an estimator depends on the regressors alone, not on the noise. So if the
environment is theta_0 and its force comes with white noise of variance s, the error e of the
estimate goes as e <- (I - L phi') e + L noise, and its covariance as

    s C,    C <- (I - L phi') C (I - L phi')' + L L',                                   (C)

whatever the method makes of its gain: forgetting, a bounded trace, a gradient. A Riccati
covariance P holds for one method under its own assumptions; C holds for each of them (P. S.
Maybeck, "Stochastic Models, Estimation, and Control", vol. 1, 1979, section 6.8, performance of
a filter of any gain).

The force error then has the variance s (1 + phi' C phi), which gives s. An error that comes from
the first guess more than from noise has less weight by as much, and so has one of a sample that
moves nothing. Where noise is correlated, so that only one of `correlation` samples counts, C is
larger by as much.
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
"""Variance of the first guess of a parameter, in units of the method's own variance for it.

Before the first sample the noise is not known, and 1 N stands for it.
"""
NOISE_MEMORY = 1.0
"""Memory [s] of the noise variance."""
CORRELATED = 1.0 - 1e-12
"""Largest correlation of two parameters; rounding may give more."""
LEAST = 1e-100
"""A sample of less weight has no information on the noise."""


@dataclass(frozen=True, slots=True)
class LinearGainParameters:
    """What `correct` needs."""

    correlation: float
    """Samples for each independent one, >= 1."""


@dataclass(slots=True)
class LinearGainState(State):
    """What `correct` updates."""

    L: Vector
    """Gain, (m,); the method computes it before it calls `correct`."""
    C: Matrix
    """Covariance of theta for a noise variance of 1, (m, m)."""
    C_phi: Vector
    """C phi, (m,)."""
    noise: float
    """Variance s of the noise [N^2]."""
    evidence: float
    """Sum of the weights of the samples that gave `noise`."""


def correct(
    parameters: LinearGainParameters,
    state: LinearGainState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Theta <- theta + L (f - phi' theta), C by (C), and the standard deviations sqrt(s C_ii)."""
    theta, std, L, C, C_phi = state.theta, state.std, state.L, state.C, state.C_phi
    indices = below[len(phi)]
    error = f
    spread = 1.0
    learned = 0.0
    for i in indices:
        row = C[i]
        total = 0.0
        for j in indices:
            total += row[j] * phi[j]
        C_phi[i] = total
        regressor = phi[i]
        error -= regressor * theta[i]
        spread += regressor * total
        learned += regressor * L[i]
    if spread < 1.0:  # by rounding
        spread = 1.0
    if learned > LEAST * spread:
        update_noise(state, error, spread, learned, dt)
    noise = parameters.correlation * state.noise
    for i in indices:
        move = L[i]
        row = C[i]
        theta[i] += move * error
        covariance = C_phi[i]
        change = spread * move - covariance
        for j in below[i]:
            row[j] = C[j][i] = row[j] - move * C_phi[j] + change * L[j]
        # (I - L phi') C (I - L phi')' is not negative, but rounding may make it so
        variance = row[i] + move * (change - covariance)
        least = move * move
        if variance < least:
            variance = least
        row[i] = variance
        std[i] = sqrt(noise * variance)


def update_noise(
    state: LinearGainState, error: float, spread: float, learned: float, dt: float
) -> None:
    """Mean of error^2 / spread, each sample with the weight phi' L / spread.

    Weights decay within `NOISE_MEMORY`. A sample has no more weight for a gap before it: it is
    one error however long the gap was.
    """
    certainty = 1.0 / spread
    weight = learned * certainty
    kept = 1.0 - dt / NOISE_MEMORY
    evidence = weight + (kept * state.evidence if kept > 0.0 else 0.0)
    state.evidence = evidence
    state.noise += weight / evidence * (error * error * certainty - state.noise)


def linear_gain_state(guess_variance: Sequence[float]) -> dict[str, Any]:
    """The fields of a `LinearGainState` before the first sample, by name."""
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
    """An estimator theta <- theta + L (f - phi' theta), whose step ends with `correct`.

    Its parameters are a `LinearGainParameters` and its state a `LinearGainState`, or derived
    from these.

    Parameters
    ----------
    parameters, initial_state, model
        As `Estimator`. In the parameters, `correlation` is the number of samples for each
        independent one: white noise of the force has 1, and noise behind a filter of bandwidth
        B sampled at a rate of r has r / 2B.

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
        """Compute the gain L, put it into the state, and `correct`."""

    @property
    def covariance(self) -> Floats:
        """Covariance of the estimate for constant parameters, shape (m, m)."""
        C = np.array(self.state.C)
        deviations = np.sqrt(np.diag(C))
        most = CORRELATED * np.outer(deviations, deviations)
        np.fill_diagonal(most, np.diag(C))
        noise = self.state.noise * self.parameters.correlation
        return np.asarray(noise * np.clip(C, -most, most))
