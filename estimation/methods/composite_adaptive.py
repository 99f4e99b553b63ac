"""Composite adaptation with bounded-gain forgetting (CA)."""

from __future__ import annotations

import math

from estimation.checks import positive_values
from estimation.compiled import Parameters, Regressors, State
from estimation.estimator import Estimator
from estimation.model import KELVIN_VOIGT, Model

LARGEST = 10.0
"""A sample of more than this many typical sizes is scaled down to it, its force with it."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """One period of implicit Euler, in units of the regressors' sizes.

    The method's own state is filtered phi W (m) and f, the information R (m x m), its
    triangular factor U (m x m), phi in units of the sizes (m), and the move of theta (m).
    """
    m = len(phi)
    filtered = 2 * m + 1
    r = filtered + m + 1
    u = r + m * m
    scaled = u + m * m
    move = scaled + m
    square = 0.0
    error = f
    for i in range(m):
        value = phi[i] * parameters[4 + i]
        state[scaled + i] = value
        square += value * value
        error -= phi[i] * state[i]
    norm = max(1.0, math.sqrt(square) / LARGEST)
    error /= norm
    share = -math.expm1(-parameters[0] * dt)
    state[filtered + m] += share * (f / norm - state[filtered + m])
    filtered_error = state[filtered + m]
    for i in range(m):
        state[scaled + i] /= norm
        state[filtered + i] += share * (state[scaled + i] - state[filtered + i])
        filtered_error -= state[filtered + i] / parameters[4 + i] * state[i]
    kept = math.exp(-parameters[1] * dt)
    floor = (1.0 - kept) * parameters[3]
    weight = min(dt, 1.0 / parameters[1])
    instant = parameters[2] * weight
    for i in range(m):
        now = instant * state[scaled + i]
        behind = weight * state[filtered + i]
        state[move + i] = error * now + filtered_error * behind
        for j in range(i + 1):
            value = kept * state[r + i * m + j] + behind * state[filtered + j]
            state[r + i * m + j] = value
            state[u + i * m + j] = value + now * state[scaled + j]
        state[r + i * m + i] += floor
        state[u + i * m + i] += floor
    solve(parameters, state, phi)
    for i in range(m):
        state[i] += state[move + i] * parameters[4 + i]


def solve(parameters: Parameters, state: State, phi: Regressors) -> None:
    """Move <- (R + instant s s')^-1 move, by Cholesky's factors in place of the matrix at u."""
    m = len(phi)
    u = 3 * m + 2 + m * m
    move = u + m * m + m
    for i in range(m):
        pivot = state[u + i * m + i]
        total = state[move + i]
        for j in range(i):
            value = state[u + i * m + j]
            for n in range(j):
                value -= state[u + i * m + n] * state[u + j * m + n]
            value /= state[u + j * m + j]
            state[u + i * m + j] = value
            pivot -= value * value
            total -= value * state[move + j]
        # it is no less than the information's floor, and neither may it be by rounding
        pivot = math.sqrt(max(pivot, parameters[3]))
        state[u + i * m + i] = pivot
        state[move + i] = total / pivot
    for back in range(m):
        row = m - 1 - back
        for j in range(row + 1, m):
            state[move + row] -= state[u + j * m + row] * state[move + j]
        state[move + row] /= state[u + row * m + row]


class CompositeAdaptive(Estimator):
    """Composite adaptation: the force error and a filtered prediction error drive theta.

    After J.-J. E. Slotine and W. Li, "Applied Nonlinear Control", 1991, sections 8.7 and 8.8,
    as K. Hashtrudi-Zaad and S. E. Salcudean, "Adaptive transparent impedance reflecting
    teleoperation", IEEE International Conference on Robotics and Automation, 1996, use it on
    the environment of a teleoperator. With W and f_W the regressors and the force behind a
    first-order lag,

        theta' = P (W (f_W - W' theta) + instant phi (f - phi' theta)),
        d(P^-1)/dt = -lambda (P^-1 - P_0^-1) + W W',

    with Slotine and Li's (8.115) for the forgetting: P never exceeds P_0, its first value, and
    lambda does not fade as it does with lambda (1 - |P| / |P_0|), so k is followed even while
    the motion tells nothing of b. The force error stands where the published law has the
    tracking error of the force loop, which is left. V = (theta - theta_0)' P^-1 (theta -
    theta_0) never grows, and neither by implicit Euler, for any settings and any `dt`.

    There is no standard deviation: the filter makes noise correlate.

    Parameters
    ----------
    forgetting_rate
        lambda [1/s].
    sizes
        Typical size (rms) of each regressor, [m/s] for v, [m] for x. One setting serves a
        tenth of them to ten times them.
    bandwidth
        Of the filter [1/s].
    instant
        Weight of the force error beside the filtered one, >= 0.
    bound
        P_0 in units of lambda over the squared sizes; what sufficient motion has is about 1.
    model
        The regressors.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    step = staticmethod(step)
    helpers = (solve,)

    def __init__(
        self,
        forgetting_rate: float,
        sizes: tuple[float, ...],
        bandwidth: float = 100.0,
        instant: float = 0.3,
        bound: float = 1e3,
        model: Model = KELVIN_VOIGT,
    ) -> None:
        if not 0.0 <= instant <= 1e6:
            raise ValueError(f"instant weight must be between 0 and 1e6, got {instant}")
        if not 1.0 <= bound <= 1e9:
            raise ValueError(f"bound must be between 1 and 1e9, got {bound}")
        for name, value in (("forgetting rate", forgetting_rate), ("bandwidth", bandwidth)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        per_size = [1.0 / size for size in positive_values("sizes", sizes, model)]
        m = model.regressors
        floor = 1.0 / (bound * forgetting_rate)
        information = [0.0] * (m * m)
        information[:: m + 1] = [floor] * m
        own_state = (*[0.0] * (m + 1), *information, *[0.0] * (m * m + 2 * m))
        super().__init__(
            (bandwidth, forgetting_rate, instant, floor, *per_size),
            (*[0.0] * m, *[math.nan] * m, 0.0, *own_state),
            model,
        )
