"""A covariance kept as U-D factors, P = U D U', U unit upper triangular and D diagonal.

P so kept is positive definite whatever the rounding, and has the precision of a square root
(G. J. Bierman, "Factorization Methods for Discrete Sequential Estimation", Academic Press, 1977).

It is the covariance of the parameters in units of the deviation s_i of their first guess, for
regressors z_i = s_i phi_i, so that P begins as I whatever the units of phi. The parameters
of a step are

    the two of `correct`, s (m), forgetting factor, forgetting rate, what the method itself needs

and the method's own state is U (m x m), D (m), and a vector y (m) that each function below
reads, changes, or both.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import ClassVar

import numpy as np

from estimation.checks import positive_values
from estimation.compiled import Floats, Parameters, Regressors, State
from estimation.estimator import Estimates
from estimation.linear_gain import LinearGainEstimator, correct, own
from estimation.model import KELVIN_VOIGT, Model
from estimation.unrolled import Helpers

WINDUP = 1e10
"""A variance grows by forgetting to this multiple of its initial value at the most."""


def kept(parameters: Parameters, state: State, phi: Regressors, dt: float) -> float:
    """Share of the information that is kept: beta, or more where a variance would wind up.

    Whichever direction is forgotten, no variance grows by more than 1/beta, so none ever
    exceeds `WINDUP` times its initial value.
    """
    m = len(phi)
    u = 4 * m + 3 + m * m
    d = u + m * m
    beta = parameters[2 + m]
    if parameters[3 + m] > 0.0:
        beta = math.exp(-parameters[3 + m] * dt)
    for i in range(m):
        variance = state[d + i]
        for j in range(i + 1, m):
            variance += state[u + i * m + j] * state[u + i * m + j] * state[d + j]
        if variance > beta * WINDUP:
            beta = variance / WINDUP
    return beta if beta < 1.0 else 1.0


def scale(parameters: Parameters, state: State, phi: Regressors) -> None:
    """Make y the scaled regressors z."""
    m = len(phi)
    y = 4 * m + 3 + 2 * m * m + m
    for i in range(m):
        state[y + i] = parameters[2 + i] * phi[i]


def project(state: State, phi: Regressors) -> float:
    """Make U' y of y; return y' P y."""
    m = len(phi)
    u = 4 * m + 3 + m * m
    d = u + m * m
    y = d + m
    news = 0.0
    for n in range(m):
        j = m - 1 - n
        for i in range(j):
            state[y + j] += state[u + i * m + j] * state[y + i]
        news += state[y + j] * state[y + j] * state[d + j]
    return news


def take_in(state: State, phi: Regressors, noise: float) -> float:
    """P <- P - P z z' P / (noise + z' P z), with y = U' z; return the denominator.

    Leaves P z, with the former P, in the place of the gain. Bierman's update (1977, chapter V).
    """
    m = len(phi)
    gain = 2 * m + 3
    u = 4 * m + 3 + m * m
    d = u + m * m
    y = d + m
    now = noise
    for j in range(m):
        before = now
        state[gain + j] = state[d + j] * state[y + j]
        now += state[y + j] * state[gain + j]
        state[d + j] *= before / now
        for i in range(j):
            former = state[u + i * m + j]
            state[u + i * m + j] -= state[gain + i] * state[y + j] / before
            state[gain + i] += state[gain + j] * former
    return now


def add(state: State, phi: Regressors, weight: float) -> None:
    """P <- P + weight y y', weight >= 0; y is used up.

    W. S. Agee and R. H. Turner, "Triangular decomposition of a positive definite matrix plus a
    symmetric dyad", White Sands Missile Range, technical report 38, 1972.
    """
    m = len(phi)
    u = 4 * m + 3 + m * m
    d = u + m * m
    y = d + m
    left = weight
    for n in range(m):
        j = m - 1 - n
        former = state[d + j]
        part = left * state[y + j]
        state[d + j] += part * state[y + j]
        part /= state[d + j]
        left *= former / state[d + j]
        for i in range(j):
            state[y + i] -= state[y + j] * state[u + i * m + j]
            state[u + i * m + j] += part * state[y + i]


def learn(
    parameters: Parameters, state: State, phi: Regressors, f: float, dt: float, spread: float
) -> None:
    """`correct` with the gain P z / spread, where `take_in` left P z."""
    m = len(phi)
    gain = 2 * m + 3
    certainty = 1.0 / spread
    for i in range(m):
        state[gain + i] *= parameters[2 + i] * certainty
    correct(parameters, state, phi, f, dt)


class FactoredEstimator(LinearGainEstimator):
    """An estimator whose gain comes from a covariance kept as U-D factors.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0, for b [(N s/m)^2] and k [(N/m)^2] and what else the model has, per N^2
        of force variance.
    sample_period
        Time [s] over which a weight falls by beta; without, it falls by beta each sample.
    settings
        What else the method's step needs.
    model
        The regressors.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.
    guess_variance
        Variance of the first guess; the initial covariance unless given.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    helpers: ClassVar[Helpers] = (correct, kept, scale, project, take_in, add, learn)

    def __init__(
        self,
        forgetting: float,
        initial_covariance: tuple[float, ...],
        sample_period: float | None,
        settings: Parameters = (),
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
        guess_variance: tuple[float, ...] | None = None,
    ) -> None:
        if not 0.0 < forgetting <= 1.0:
            raise ValueError(f"forgetting factor must be in (0, 1], got {forgetting}")
        if sample_period is not None and not 0.0 < sample_period < math.inf:
            raise ValueError(f"sample period must be positive, got {sample_period}")
        p0 = positive_values("initial covariance", initial_covariance, model)
        m = model.regressors
        rate = -math.log(forgetting) / sample_period if sample_period else 0.0
        super().__init__(
            (*map(math.sqrt, p0), forgetting, rate, *settings),
            guess_variance=guess_variance or p0,
            own_state=[*np.eye(m).flat, *[1.0] * m, *[0.0] * m],
            model=model,
            correlation=correlation,
        )

    @staticmethod
    @abstractmethod
    def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
        """Move U and D on, and `learn`."""

    @property
    def scaled_covariance(self) -> Floats:
        """P, in units of the deviations of the first guess, shape (m, m)."""
        m = len(self.names)
        u, d = own(m), own(m) + m * m
        factor = np.reshape(self.state[u:d], (m, m))
        p: Floats = factor * self.state[d : d + m] @ factor.T
        return p

    def note(self, estimates: Estimates) -> str | None:
        """Whether the covariance has wound up."""
        if np.any(np.diag(self.scaled_covariance) > 0.5 * WINDUP):
            return "too little motion: the covariance has wound up and forgetting is held"
        return None
