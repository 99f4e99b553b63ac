"""Exponentially weighted least squares (EWLS), with the constraint of a passive environment."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from estimation.methods.recursive_least_squares import step as least_squares_step
from estimation.methods.ud_factors import FactoredEstimator, FactoredParameters, FactoredState
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, Vector, below, diagonal, zeros

SIGNED = ("f0",)
"""Parameters that may be negative in a passive environment."""
ROUNDING = 1e-15
"""When a parameter is fixed at zero, at least this fraction of each other variance remains."""


@dataclass(frozen=True, slots=True)
class PassiveParameters(FactoredParameters):
    """Constant settings of the function `step`."""

    bounded: tuple[int, ...]
    """1 for each parameter that must not be negative, 0 for the others, (m,)."""


@dataclass(slots=True)
class PassiveState(FactoredState):
    """Variables that the function `step` updates."""

    free: Vector
    """Estimate without the constraint, (m,)."""
    P: Matrix
    """Covariance of theta for noise of variance 1 N^2, given that some parameters are fixed at
    zero, (m, m)."""


def multiply_out(parameters: PassiveParameters, state: PassiveState) -> None:
    """Compute the covariance P = U D U', in the units of theta."""
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

    Parameters that may be negative are ignored. The result is -1 if no other parameter is negative.
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
    """Update the unconstrained estimate, and then compute the passive estimate from it.

    In the passive estimate, no parameter except f0 is negative. Negative parameters are set to
    zero one after the other, see `fix_at_zero`.
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

    The method is based on M. B. Colton, J. M. Hollerbach, "Identification of nonlinear passive
    devices for haptic simulations", World Haptics, 2005, and "Reality-based haptic force models
    of buttons and switches", IEEE Int. Conf. Robotics and Automation, 2007. Colton and Hollerbach
    identify a passive device by EWLS,

        sum_n beta^(N-n) (f_n - phi_n' theta)^2 + beta^N theta' P0^-1 theta -> min.

    In these papers, the parameters depend on position and direction, and the model has Coulomb
    friction. Both are omitted here. The constraint is not in these papers: no parameter except f0
    is negative.

    The estimate is the passive theta that is nearest to the unconstrained minimum, in the metric
    of the information matrix P^-1. Negative parameters are set to zero one after the other. The
    first is the parameter whose ratio of magnitude to standard deviation is largest. For a model
    with b and k only, the result is the exact constrained minimum. For more parameters, the result
    is nearly always the exact constrained minimum. The recursion continues from the unconstrained
    minimum. The standard deviations are those of the unconstrained minimum.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0: the initial variances of b [(N s/m)^2], k [(N/m)^2] and any further
        parameters of the model, for force noise with a variance of 1 N^2.
    sample_period
        Time [s] in which the weight of a past sample is multiplied by beta. Default: the weight is
        multiplied by beta at each sample, independent of `dt`.
    model
        Model that defines the regressors.
    correlation
        Number of samples per independent value of the force noise, see `LinearGainEstimator`.

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

    def first_state(self, guess_variance: tuple[float, ...]) -> PassiveState:
        """Return the state before the first sample: U D U' = I, and all estimates are zero."""
        m = len(guess_variance)
        return PassiveState(
            **asdict(super().first_state(guess_variance)), free=zeros(m), P=diagonal(zeros(m))
        )
