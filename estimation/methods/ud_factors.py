"""Store a covariance as U-D factors, P = U D U', with U unit upper triangular and D diagonal.

With these factors, P remains positive definite in spite of rounding errors (G. J. Bierman,
"Factorization Methods for Discrete Sequential Estimation", 1977). P is the covariance of the scaled
parameters theta_i / s_i, for a noise variance of 1 N^2. s_i is the initial standard deviation of
theta_i, so P is the identity matrix I at the start. The scaled regressors are z_i = s_i phi_i.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from estimation.arrays import Floats
from estimation.checks import check_positive, positive_values
from estimation.estimator import Estimates
from estimation.linear_gain import (
    LinearGainEstimator,
    LinearGainParameters,
    LinearGainState,
    correct,
    linear_gain_state,
)
from estimation.method_settings import SIZES, MethodSettings
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, Vector, below, diagonal, zeros

WINDUP = 1e10
"""Upper limit of each variance during forgetting, relative to the initial variance."""


@dataclass(frozen=True, slots=True)
class FactoredParameters(LinearGainParameters):
    """Constant settings of the functions that update the covariance P and its factors U and D."""

    s: tuple[float, ...]
    """Initial standard deviation of each of the m parameters, shape (m,)."""
    beta: float
    rate: float
    """Forgetting rate [1/s]. The forgetting factor is exp(-rate dt), or `beta` if `rate` is 0."""


@dataclass(slots=True)
class FactoredState(LinearGainState):
    """Variables that change at each sample, including the factors U and D of the covariance P."""

    U: Matrix
    D: Vector
    """Factors of P. U is stored by columns: U_ij is `U[j][i]`. D is stored as its diagonal."""
    y: Vector
    """Vector y of the function `add`, shape (m,)."""
    bound: float
    """Upper bound of the trace of P."""
    dt: float
    beta: float
    """Forgetting factor for a sample that follows the previous sample after the time `dt` [s]."""


def forgetting_factor(parameters: FactoredParameters, state: FactoredState, dt: float) -> float:
    """Return the forgetting factor of a sample, such that no variance exceeds its limit.

    The limit is `WINDUP` times the initial variance. Forgetting increases a variance to at most
    variance / factor. So if a variance is near its limit, a factor closer to 1 is returned. To save
    time, the variances are computed only if an upper bound of their sum exceeds the limit.
    """
    if dt != state.dt:  # usually the sample period is constant
        state.dt = dt
        rate = parameters.rate
        state.beta = math.exp(-rate * dt) if rate > 0.0 else parameters.beta
    beta = state.beta
    if state.bound > beta * WINDUP:
        state.bound = trace(state)
        if state.bound > beta * WINDUP:
            for i in below[len(state.D)]:
                beta = max(beta, variance(state, i) / WINDUP)
    state.bound /= beta
    return beta if beta < 1.0 else 1.0


def trace(state: FactoredState) -> float:
    """Return the trace of P, which is the sum of the variances of the scaled parameters."""
    U, D = state.U, state.D
    total = 0.0
    for j in below[len(D)]:
        column = U[j]
        squares = 1.0
        for i in below[j]:
            squares += column[i] * column[i]
        total += squares * D[j]
    return total


def variance(state: FactoredState, i: int) -> float:
    """Return the variance P_ii of scaled parameter i: D_i + the sum of U_ij^2 D_j over j > i."""
    U, D = state.U, state.D
    total = D[i]
    for n in below[len(D) - 1 - i]:
        j = i + 1 + n
        total += U[j][i] * U[j][i] * D[j]
    return total


def predicted_variance(
    parameters: FactoredParameters, state: FactoredState, phi: Regressors
) -> float:
    """Return the variance of the predicted force phi' theta [N^2], for a noise variance of 1."""
    s, U, D = parameters.s, state.U, state.D
    m = len(phi)
    total = 0.0
    for n in below[m]:
        j = m - 1 - n
        column = U[j]
        y = s[j] * phi[j]
        for i in below[j]:
            y += column[i] * (s[i] * phi[i])
        total += y * y * D[j]  # the sum is z' P z, with y = U' z
    return total


def update_covariance(
    parameters: FactoredParameters, state: FactoredState, phi: Regressors, noise: float
) -> float:
    """Update the covariance P with one sample: set P <- P - P z z' P / d, and return d.

    z contains the scaled regressors z_i = s_i phi_i, and d is `noise` + z' P z. `noise` is the
    assumed variance of the force noise [N^2]. P z, with P before the update, is stored in
    `state.L`. The algorithm is from Bierman (1977, chapter V). Its vector y is U' z.
    """
    s, U, D, L = parameters.s, state.U, state.D, state.L
    now = noise
    for j in below[len(phi)]:
        column = U[j]
        y = s[j] * phi[j]
        earlier = below[j]
        for i in earlier:
            y += column[i] * (s[i] * phi[i])
        before = now
        gain = D[j] * y
        now += y * gain
        D[j] *= before / now
        for i in earlier:
            former = column[i]
            column[i] -= L[i] * y / before
            L[i] += gain * former
        L[j] = gain
    return now


def add(state: FactoredState, weight: float, columns: int) -> None:
    """Set P <- P + weight y y', with weight >= 0. y is `state.y`, and is overwritten.

    All elements of y after the first `columns` elements are treated as zero. Source: W. S. Agee and
    R. H. Turner, "Triangular decomposition of a positive definite matrix plus a symmetric dyad",
    White Sands Missile Range, technical report 38, 1972.
    """
    U, D, y = state.U, state.D, state.y
    left = weight
    for n in below[columns]:
        j = columns - 1 - n
        column = U[j]
        value = y[j]
        former = D[j]
        part = left * value
        now = former + part * value
        D[j] = now
        if j > 0:
            part /= now
            left *= former / now
            for i in below[j]:
                y[i] -= value * column[i]
                column[i] += part * y[i]


def add_variance(state: FactoredState, i: int, weight: float) -> None:
    """Add `weight` >= 0 to the variance P_ii of the scaled parameter i. The rest of P is kept."""
    D, column, y = state.D, state.U[i], state.y
    former = D[i]
    D[i] = former + weight
    part = weight / D[i]
    for j in below[i]:
        y[j] = -column[j]
        column[j] += part * y[j]
    if i > 0:
        add(state, weight * (former / D[i]), i)


def correct_with_gain(
    parameters: FactoredParameters,
    state: FactoredState,
    phi: Regressors,
    f: float,
    dt: float,
    spread: float,
) -> None:
    """Update the estimate theta with the gain L_i = s_i (P z)_i / spread, where z_i = s_i phi_i.

    Call `update_covariance` before. It stores the vector P z in `state.L`, and returns `spread`.
    """
    s, L = parameters.s, state.L
    certainty = 1.0 / spread
    for i in below[len(phi)]:
        L[i] *= s[i] * certainty
    correct(parameters, state, phi, f, dt)


def forgetting_rate(forgetting: float, sample_period: float | None) -> float:
    """Return the forgetting rate -ln(forgetting) / sample_period [1/s]; 0 if the period is None."""
    if not 0.0 < forgetting <= 1.0:
        raise ValueError(f"forgetting factor must be in (0, 1], got {forgetting}")
    if sample_period is not None:
        check_positive(sample_period=sample_period)
    return -math.log(forgetting) / sample_period if sample_period else 0.0


class FactoredEstimator(LinearGainEstimator):
    """Base class of estimators whose gain is computed from a covariance in U-D factors.

    The arguments are those of `RecursiveLeastSquares`. `own` contains the additional settings of a
    derived class, by name: the further fields of its `parameter_type`.
    """

    parameter_type: ClassVar[type[FactoredParameters]] = FactoredParameters
    parameters: FactoredParameters
    state: FactoredState
    used_settings: ClassVar[tuple[str, ...] | None] = ("forgetting", *SIZES)

    def __init__(
        self,
        forgetting: float,
        initial_covariance: tuple[float, ...],
        sample_period: float | None = None,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
        guess_variance: tuple[float, ...] | None = None,
        **own: Any,
    ) -> None:
        rate = forgetting_rate(forgetting, sample_period)
        p0 = positive_values("initial covariance", initial_covariance, model)
        s = tuple(map(math.sqrt, p0))
        parameters = self.parameter_type(correlation, s, forgetting, rate, **own)
        super().__init__(parameters, self.first_state(guess_variance or p0), model)

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            settings.forgetting,
            settings.covariance,
            settings.sample_period,
            model=settings.model,
            correlation=settings.correlation,
        )

    def first_state(self, guess_variance: tuple[float, ...]) -> FactoredState:
        """Return the state before the first sample: theta is zero, P is the identity matrix I."""
        m = len(guess_variance)
        return FactoredState(
            **linear_gain_state(guess_variance),
            U=diagonal([1.0] * m),
            D=[1.0] * m,
            y=zeros(m),
            bound=float(m),
            dt=0.0,
            beta=1.0,
        )

    @staticmethod
    @abstractmethod
    def step(parameters: Any, state: Any, phi: Regressors, f: float, dt: float) -> None:
        """Process one sample: update the factors of P, then theta with `correct_with_gain`."""

    @property
    def scaled_covariance(self) -> Floats:
        """Covariance P of theta_i / s_i, with the initial standard deviations s_i, shape (m, m)."""
        U = np.array(self.state.U).T
        p: Floats = U * self.state.D @ U.T
        return p

    def note(self, estimates: Estimates) -> str | None:
        """Return a warning if a variance in P is above 0.5 times its limit `WINDUP`, or None."""
        if np.any(np.diag(self.scaled_covariance) > 0.5 * WINDUP):
            return "too little motion: the covariance is at its limit and forgetting is suspended"
        return None
