"""Exponentially weighted least squares (EWLS) without negative damping or stiffness."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Self

from estimation.method_settings import MethodSettings
from estimation.methods.recursive_least_squares import step as least_squares_step
from estimation.methods.ud_factors import FactoredEstimator, FactoredParameters, FactoredState
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, Vector, below, diagonal, zeros

SIGNED = ("f0",)
"""Parameters that may be negative in a passive environment; `f0` is a constant force."""
ROUNDING = 1e-15
"""When a parameter is fixed at zero, the variances of the other parameters decrease.

Each variance decreases at most to this fraction of its value.
"""
FORGETTING = 1.25
"""The forgetting factor of `passive` is the preset's forgetting factor to this power.

The settling time (see `benchmarks/tuning.py`) is 0.29 s, and 0.31 s for 0.8 times this value.
"""


@dataclass(frozen=True, slots=True)
class PassiveParameters(FactoredParameters):
    """Constant settings of the estimator `PassiveLeastSquares`."""

    bounded: tuple[int, ...]
    """1 for each parameter that must not be negative, 0 for the others, (m,)."""


@dataclass(slots=True)
class PassiveState(FactoredState):
    """Variables of the estimator `PassiveLeastSquares` that change at each sample."""

    free: Vector
    """Estimate without the constraint that parameters are not negative, (m,)."""
    P: Matrix
    """Covariance of theta for force noise with a variance of 1 N^2, (m, m). If some parameters are
    fixed at zero, this is the covariance under this condition."""


def multiply_out(parameters: PassiveParameters, state: PassiveState) -> None:
    """Compute the covariance P of the parameters theta from its factors, and store it in `state`.

    U and D are the factors of the covariance U D U' of the scaled parameters theta_i / s_i. s_i is
    the square root of the initial variance. So P_ij = s_i s_j (U D U')_ij.
    """
    s, U, D, P = parameters.s, state.U, state.D, state.P
    m = len(D)
    for i in below[m]:
        for j in below[i + 1]:
            total = D[i]
            if j < i:
                total *= U[i][j]
            for later in below[m - 1 - i]:
                n = i + 1 + later
                total += D[n] * U[n][i] * U[n][j]
            total *= s[i] * s[j]
            P[i][j] = total
            P[j][i] = total


def most_negative(parameters: PassiveParameters, state: PassiveState) -> int:
    """Return the index of the negative parameter with the largest |theta_i| / (standard deviation).

    The constant force f0 is ignored, because it may be negative. The result is -1 if none of the
    other parameters is negative.
    """
    theta, P = state.theta, state.P
    found = -1
    most = 0.0
    for i in below[len(theta)]:
        if parameters.bounded[i] == 1 and theta[i] < 0.0:
            deviations = -theta[i] / math.sqrt(P[i][i])
            if deviations >= most:
                most = deviations
                found = i
    return found


def fix_at_zero(state: PassiveState, n: int) -> None:
    """Fix parameter n at zero, and set the other parameters to their conditional expectation.

    The condition is that parameter n is zero. The estimate theta and its covariance P become

        theta <- theta - P e theta_n / P_nn,    P <- P - P e e' P / P_nn,

    where e is the n-th unit vector.
    """
    theta, P = state.theta, state.P
    m = len(theta)
    row = P[n]
    pivot = row[n]
    excess = theta[n] / pivot
    for i in below[m]:
        theta[i] -= row[i] * excess
        least = ROUNDING * P[i][i]
        for j in below[m]:
            if i != n and j != n:
                P[i][j] -= row[i] * row[j] / pivot
        P[i][i] = max(P[i][i], least)
    theta[n] = 0.0
    for i in below[m]:
        row[i] = 0.0
        P[i][n] = 0.0


def step(
    parameters: PassiveParameters, state: PassiveState, phi: Regressors, f: float, dt: float
) -> None:
    """Process one sample: update the unconstrained estimate, and compute the passive estimate.

    The unconstrained estimate is that of recursive least squares. In the passive estimate, no
    parameter is negative, except the constant force f0 if the model contains it. Negative
    parameters are set to zero one after the other. Each time, the other parameters are corrected by
    the function `fix_at_zero`.
    """
    theta, free, bounded = state.theta, state.free, parameters.bounded
    indices = below[len(phi)]
    for i in indices:
        theta[i] = free[i]
    least_squares_step(parameters, state, phi, f, dt)
    outside = False
    for i in indices:
        value = theta[i]
        free[i] = value
        if value < 0.0 and bounded[i] == 1:
            outside = True
    if outside:
        multiply_out(parameters, state)
        n = most_negative(parameters, state)
        while n >= 0:
            fix_at_zero(state, n)
            n = most_negative(parameters, state)


class PassiveLeastSquares(FactoredEstimator):
    """Exponentially weighted least squares (EWLS) with the constraint of a passive environment.

    The constraint is that no parameter is negative. The only exception is the parameter f0, a
    constant force that some models contain. The method is based on M. B. Colton, J. M. Hollerbach,
    "Identification of nonlinear passive devices for haptic simulations", World Haptics, 2005, and
    "Reality-based haptic force models of buttons and switches", IEEE Int. Conf. Robotics and
    Automation, 2007. Colton and Hollerbach identify a passive device by EWLS: the parameters theta
    minimise

        sum_n beta^(N-n) (f_n - phi_n' theta)^2 + beta^N theta' P0^-1 theta,

    where f_n is the force and phi_n contains the regressors of sample n. In their papers, the
    parameters depend on position and direction, and the model has Coulomb friction. Both are
    omitted here. Their papers do not contain the constraint.

    At each sample, the minimum theta_u without the constraint is computed recursively, with its
    covariance P. The estimate is the theta that satisfies the constraint and for which
    (theta - theta_u)' P^-1 (theta - theta_u) is smallest. It is computed from theta_u as follows.
    The negative parameter with the largest ratio of magnitude to standard deviation is set to zero,
    and the other parameters are corrected. This is repeated until no parameter is negative. For a
    model with b and k only, the result is exact. For more parameters, it is nearly always exact.

    The next sample updates theta_u, not the constrained estimate. The standard deviations are those
    of theta_u.

    Parameters
    ----------
    forgetting, initial_covariance, sample_period
        As in `RecursiveLeastSquares`.
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    parameter_type = PassiveParameters

    def __init__(
        self,
        forgetting: float,
        initial_covariance: tuple[float, ...],
        sample_period: float | None = None,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        bounded = tuple(int(name not in SIGNED) for name in model.parameters)
        super().__init__(
            forgetting, initial_covariance, sample_period, model, correlation, bounded=bounded
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            settings.forgetting**FORGETTING,
            settings.covariance,
            settings.sample_period,
            settings.model,
            settings.correlation,
        )

    def first_state(self, guess_variance: tuple[float, ...]) -> PassiveState:
        """Return the state before the first sample, in which all estimates are zero.

        `guess_variance` contains, for each parameter, the variance of the error of the initial
        guess zero. It has an effect only on the standard deviations.
        """
        m = len(guess_variance)
        return PassiveState(
            **asdict(super().first_state(guess_variance)), free=zeros(m), P=diagonal(zeros(m))
        )
