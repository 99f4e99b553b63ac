"""What all estimators of the form theta <- theta + L (f - phi' theta) share: an honest interval.

The gain L of such an estimator depends on the regressors alone, not on the noise. So if the
environment is theta_0 and its force comes with white noise of variance s, the error e of the
estimate goes as e <- (I - L phi') e + L noise, and its covariance as

    s C,    C <- (I - L phi') C (I - L phi')' + L L',

whatever the method makes of its gain: forgetting, a bounded trace, a gradient. A Riccati
covariance P holds for one method under its own assumptions; C holds for each of them (P. S.
Maybeck, "Stochastic Models, Estimation, and Control", vol. 1, 1979, section 6.8, performance of
a filter of any gain).

The force error then has the variance s (1 + phi' C phi), from which s is had. An error that tells
of the first guess more than of noise weighs less by as much, and so does one that moves nothing.
Where noise is correlated over so many samples that only one of `correlation` counts, C is larger
by as much.

A state of m regressors is

    theta (m), standard deviations (m), held, evidence, noise variance, L (m), C (m x m), C phi (m)

and from `own(m)` on what the method itself needs.
"""

from __future__ import annotations

from abc import abstractmethod
from math import sqrt
from typing import ClassVar

import numpy as np

from estimation.checks import check_correlation
from estimation.compiled import Floats, Parameters, Regressors, State
from estimation.estimator import Estimator
from estimation.model import KELVIN_VOIGT, Model
from estimation.unrolled import Helpers

DIFFUSE = 1e4
"""Variance of the first guess of a parameter, in units of what the method takes it for.

Before the first sample the noise is not known, and 1 N stands for it.
"""
NOISE_MEMORY = 1.0
"""Memory [s] of the noise variance."""
CORRELATED = 1.0 - 1e-12
"""Two parameters correlate no more than that; rounding may have it that they do."""
LEAST = 1e-100
"""A sample that weighs less tells nothing of the noise."""


def gain_at(regressors: int) -> int:
    """Index of L in the state."""
    return 2 * regressors + 3


def own(regressors: int) -> int:
    """Index from which on the state is the method's own."""
    return 4 * regressors + 3 + regressors * regressors


def correct(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Move theta by L, which stands in the state, times the force error; C and deviations too.

    The first two parameters are the rate [1/s] at which noise is forgotten and `correlation`.
    """
    m = len(phi)
    gain = 2 * m + 3
    c = gain + m
    u = c + m * m
    error = f
    for i in range(m):
        error -= phi[i] * state[i]
    spread = 1.0
    learned = 0.0
    for i in range(m):
        total = 0.0
        for j in range(m):
            total += state[c + i * m + j] * phi[j]
        state[u + i] = total
        spread += phi[i] * total
        learned += phi[i] * state[gain + i]
    if spread < 1.0:  # which is rounding
        spread = 1.0
    noise = state[2 * m + 2]
    if learned > LEAST * spread:
        certainty = 1.0 / spread
        weight = learned * certainty
        share = parameters[0] * dt
        if share > 1.0:
            share = 1.0
        evidence = (1.0 - share) * state[2 * m + 1] + share * weight
        state[2 * m + 1] = evidence
        share *= weight / evidence
        if share > 1.0:
            share = 1.0
        noise += share * (error * error * certainty - noise)
        state[2 * m + 2] = noise
    noise *= parameters[1]
    for i in range(m):
        move = state[gain + i]
        state[i] += move * error
        change = spread * move - state[u + i]
        for j in range(i):
            value = state[c + i * m + j] - move * state[u + j] + change * state[gain + j]
            state[c + i * m + j] = value
            state[c + j * m + i] = value
        # (I - L phi') C (I - L phi')' is not negative, and neither may it be by rounding
        variance = state[c + i * m + i] + move * (change - state[u + i])
        least = move * move
        if variance < least:
            variance = least
        state[c + i * m + i] = variance
        state[m + i] = sqrt(noise * variance)


class LinearGainEstimator(Estimator):
    """An estimator theta <- theta + L (f - phi' theta), whose step ends with `correct`.

    Parameters
    ----------
    parameters
        The method's own.
    guess_variance
        Variance of the first guess, zero, of each parameter, as the method takes it, per N^2
        of force variance; shape (regressors,).
    own_state
        What the method itself needs of a state.
    model
        The regressors.
    correlation
        Samples for each one that is independent, >= 1: white noise of the force has 1, and
        noise behind a filter of bandwidth B sampled at a rate of r has r / 2B.

    Raises
    ------
    ValueError
        The correlation is below 1.
    """

    helpers: ClassVar[Helpers] = (correct,)

    def __init__(
        self,
        parameters: Parameters,
        guess_variance: Parameters,
        own_state: Parameters = (),
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        check_correlation(correlation)
        m = model.regressors
        covariance = [0.0] * (m * m)
        covariance[:: m + 1] = [DIFFUSE * variance for variance in guess_variance]
        super().__init__(
            (1.0 / NOISE_MEMORY, correlation, *parameters),
            (
                *[0.0] * m,
                *[sqrt(DIFFUSE * variance) for variance in guess_variance],
                *[0.0] * (gain_at(m) - m),
                *covariance,
                *[0.0] * m,
                *own_state,
            ),
            model,
        )

    @staticmethod
    @abstractmethod
    def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
        """Find L, put it into the state, and `correct`."""

    @property
    def covariance(self) -> Floats:
        """Covariance of the estimate for constant parameters, shape (m, m)."""
        m = len(self.names)
        c = gain_at(m) + m
        matrix = np.reshape(self.state[c : c + m * m], (m, m))
        deviations = np.sqrt(np.diag(matrix))
        most = CORRELATED * np.outer(deviations, deviations)
        np.fill_diagonal(most, np.diag(matrix))
        noise = self.state[2 * m + 2] * self.parameters[1]
        return np.asarray(noise * np.clip(matrix, -most, most))
