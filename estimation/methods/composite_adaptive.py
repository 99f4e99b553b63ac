"""Composite adaptation with bounded-gain forgetting (CA)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.checks import positive_values
from estimation.estimator import Estimator
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, State, Vector, below, diagonal, zeros

LARGEST = 10.0
"""A sample of more than this many typical sizes is scaled down to it, its force with it."""


@dataclass(frozen=True, slots=True)
class CompositeParameters:
    """Parameters of `step`."""

    bandwidth: float
    """Of the filter [1/s]."""
    forgetting_rate: float
    """lambda [1/s]."""
    instant: float
    """Weight of the force error beside the filtered one."""
    floor: float
    """P_0^-1, in units of the sizes."""
    per_size: tuple[float, ...]
    """1 / typical size of each regressor, (m,)."""


@dataclass(slots=True)
class CompositeState(State):
    """State of `step`, in units of the regressors' sizes."""

    W: Vector
    """Filtered regressors, (m,)."""
    force: float
    """Filtered force f_W [N]."""
    R: Matrix
    """Information P^-1, (m, m); its upper half is not used."""
    factor: Matrix
    """R + instant s s', and then its Cholesky factor, lower triangular, (m, m)."""
    s: Vector
    """Regressors of the sample, (m,)."""
    move: Vector
    """Right-hand side of the normal equations, and then the move of theta, (m,)."""


def step(
    parameters: CompositeParameters,
    state: CompositeState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """One period of implicit Euler, in units of the regressors' sizes."""
    per_size, theta, move = parameters.per_size, state.theta, state.move
    error, filtered_error = filter_errors(parameters, state, phi, f, dt)
    gather(parameters, state, error, filtered_error, dt)
    solve(parameters, state)
    for i in below[len(phi)]:
        theta[i] += move[i] * per_size[i]


def filter_errors(
    parameters: CompositeParameters,
    state: CompositeState,
    phi: Regressors,
    f: float,
    dt: float,
) -> tuple[float, float]:
    """Filter; return the force error f - phi' theta and the filtered one f_W - W' theta."""
    per_size, theta, s, W = parameters.per_size, state.theta, state.s, state.W
    square = 0.0
    error = f
    for i in below[len(phi)]:
        value = phi[i] * per_size[i]
        s[i] = value
        square += value * value
        error -= phi[i] * theta[i]
    norm = max(1.0, math.sqrt(square) / LARGEST)
    share = -math.expm1(-parameters.bandwidth * dt)
    state.force += share * (f / norm - state.force)
    filtered_error = state.force
    for i in below[len(phi)]:
        s[i] /= norm
        W[i] += share * (s[i] - W[i])
        filtered_error -= W[i] / per_size[i] * theta[i]
    return error / norm, filtered_error


def gather(
    parameters: CompositeParameters,
    state: CompositeState,
    error: float,
    filtered_error: float,
    dt: float,
) -> None:
    """R <- R + dt R' by (8.115), and the normal equations of implicit Euler."""
    s, W, R, factor, move = state.s, state.W, state.R, state.factor, state.move
    kept = math.exp(-parameters.forgetting_rate * dt)
    floor = (1.0 - kept) * parameters.floor
    weight = min(dt, 1.0 / parameters.forgetting_rate)
    instant = parameters.instant * weight
    for i in below[len(s)]:
        now = instant * s[i]
        behind = weight * W[i]
        move[i] = error * now + filtered_error * behind
        row, factor_row = R[i], factor[i]
        for j in below[i + 1]:
            value = kept * row[j] + behind * W[j]
            row[j] = value
            factor_row[j] = value + now * s[j]
        row[i] += floor
        factor_row[i] += floor


def solve(parameters: CompositeParameters, state: CompositeState) -> None:
    """Move <- (R + instant s s')^-1 move, by Cholesky's factors in the place of the matrix."""
    factor, move, floor = state.factor, state.move, parameters.floor
    m = len(move)
    for i in below[m]:
        row = factor[i]
        pivot = row[i]
        total = move[i]
        for j in below[i]:
            value = row[j]
            for n in below[j]:
                value -= row[n] * factor[j][n]
            value /= factor[j][j]
            row[j] = value
            pivot -= value * value
            total -= value * move[j]
        # the information is no less than its floor, but rounding may make it so
        if pivot < floor:
            pivot = floor
        pivot = math.sqrt(pivot)
        row[i] = pivot
        move[i] = total / pivot
    for back in below[m]:
        i = m - 1 - back
        total = move[i]
        for later in below[back]:
            j = i + 1 + later
            total -= factor[j][i] * move[j]
        move[i] = total / factor[i][i]


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
        per_size = tuple(1.0 / size for size in positive_values("sizes", sizes, model))
        m = model.regressors
        floor = 1.0 / (bound * forgetting_rate)
        super().__init__(
            CompositeParameters(bandwidth, forgetting_rate, instant, floor, per_size),
            CompositeState(
                zeros(m),
                [math.nan] * m,
                False,
                W=zeros(m),
                force=0.0,
                R=diagonal([floor] * m),
                factor=diagonal(zeros(m)),
                s=zeros(m),
                move=zeros(m),
            ),
            model,
        )
