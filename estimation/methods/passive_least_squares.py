"""Exponentially weighted least squares of a passive environment (EWLS)."""

from __future__ import annotations

import math

from estimation.compiled import Parameters, Regressors, State
from estimation.methods.recursive_least_squares import step
from estimation.methods.ud_factors import FactoredEstimator
from estimation.model import KELVIN_VOIGT, Model

SIGNED = ("f0",)
"""Parameters that may be negative in a passive environment."""
ROUNDING = 1e-15
"""Least share of a variance that is left once another parameter is known."""


def multiply_out(parameters: Parameters, state: State, phi: Regressors) -> None:
    """P = U D U', in the units of theta, behind the unconstrained theta."""
    m = len(phi)
    u = 4 * m + 3 + m * m
    d = u + m * m
    p = d + 3 * m
    for i in range(m):
        for j in range(i + 1):
            total = state[d + i]
            if j < i:
                total *= state[u + j * m + i]
            for n in range(i + 1, m):
                total += state[d + n] * state[u + i * m + n] * state[u + j * m + n]
            total *= parameters[2 + i] * parameters[2 + j]
            state[p + i * m + j] = total
            state[p + j * m + i] = total


def worst(parameters: Parameters, state: State, phi: Regressors) -> int:
    """Which parameter is most standard deviations below a bound of zero; -1 if none is."""
    m = len(phi)
    p = 7 * m + 3 + 2 * m * m
    found = -1
    most = 0.0
    for i in range(m):
        if parameters[4 + m + i] > 0.0 and state[i] < 0.0:
            below = -state[i] / math.sqrt(state[p + i * m + i])
            if below >= most:
                most = below
                found = i
    return found


def put_at_zero(state: State, phi: Regressors, n: int) -> None:
    """Parameter n to zero, and the others to where they are likeliest then.

    theta <- theta - P e theta_n / P_nn,    P <- P - P e e' P / P_nn,    e the n-th unit vector
    """
    m = len(phi)
    p = 7 * m + 3 + 2 * m * m
    row = p + n * m
    pivot = state[row + n]
    excess = state[n] / pivot
    for i in range(m):
        state[i] -= state[row + i] * excess
        least = ROUNDING * state[p + i * m + i]
        for j in range(m):
            if i != n and j != n:
                state[p + i * m + j] -= state[row + i] * state[row + j] / pivot
        state[p + i * m + i] = max(state[p + i * m + i], least)
    state[n] = 0.0
    for i in range(m):
        state[row + i] = 0.0
        state[p + i * m + n] = 0.0


def passive_step(
    parameters: Parameters, state: State, phi: Regressors, f: float, dt: float
) -> None:
    """Recursive least squares, its theta in the own state, then the passive one nearest to it."""
    m = len(phi)
    theta = 6 * m + 3 + 2 * m * m
    for i in range(m):
        state[i] = state[theta + i]
    step(parameters, state, phi, f, dt)
    outside = False
    for i in range(m):
        state[theta + i] = state[i]
        outside = outside or (parameters[4 + m + i] > 0.0 and state[i] < 0.0)
    if outside:
        multiply_out(parameters, state, phi)
        n = worst(parameters, state, phi)
        while n >= 0:
            put_at_zero(state, phi, n)
            n = worst(parameters, state, phi)


class PassiveLeastSquares(FactoredEstimator):
    """Exponentially weighted least squares among passive environments.

    After M. B. Colton, J. M. Hollerbach, "Identification of nonlinear passive devices for haptic
    simulations", World Haptics, 2005, and "Reality-based haptic force models of buttons and
    switches", IEEE Int. Conf. Robotics and Automation, 2007. Taken from them: exponentially
    weighted least squares (EWLS) as the way to identify a passive device,

        sum_n beta^(N-n) (f_n - phi_n' theta)^2 + beta^N theta' P0^-1 theta -> min.

    Not taken: parameters stored over position and direction of motion, and Coulomb friction.
    Ours is that passivity is imposed: b, k and further parameters but f0 are not negative.

    The estimate is the passive theta nearest to the minimum in the metric of the information
    P^-1, so that what is cut off one parameter goes to the others as the data would have it.
    The parameter most standard deviations below zero is put at zero first; for b and k that
    is the constrained minimum exactly, for more than two parameters nearly always. The filter
    goes on from the minimum without constraint, and the standard deviations are that one's.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0, for b [(N s/m)^2] and k [(N/m)^2] and what else the model has, per N^2
        of force variance.
    sample_period
        Time [s] over which a sample's weight falls by beta; without, it does so each sample.
    model
        The regressors.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    helpers = (*FactoredEstimator.helpers, step, multiply_out, worst, put_at_zero)
    step = staticmethod(passive_step)

    def __init__(
        self,
        forgetting: float,
        initial_covariance: tuple[float, ...],
        sample_period: float | None = None,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        bounded = [float(name not in SIGNED) for name in model.parameters]
        super().__init__(forgetting, initial_covariance, sample_period, bounded, model, correlation)
        m = model.regressors
        self._initial_state += (0.0,) * (m + m * m)
        self.reset()
