"""Composite adaptation (CA), an estimator with two error signals and bounded-gain forgetting."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.checks import positive_values
from estimation.estimator import Estimator
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, State, Vector, below, diagonal, zeros

LARGEST = 10.0
"""Largest norm of the scaled regressors. In a sample with a larger norm, the regressors and the
force are reduced by a common factor."""


@dataclass(frozen=True, slots=True)
class CompositeParameters:
    """Constant settings of the function `step`."""

    bandwidth: float
    """Bandwidth of the filter [1/s]."""
    forgetting_rate: float
    """Forgetting rate lambda [1/s]."""
    instant: float
    """Weight of the force error, relative to the filtered prediction error."""
    floor: float
    """Value of each diagonal element of the initial information matrix P_0^-1, for regressors
    divided by their sizes."""
    per_size: tuple[float, ...]
    """1 / typical size of each regressor, (m,)."""


@dataclass(slots=True)
class CompositeState(State):
    """Variables that `step` updates.

    All regressors in these variables are divided by their typical sizes.
    """

    W: Vector
    """Filtered regressors, (m,)."""
    force: float
    """Filtered force f_W [N]."""
    R: Matrix
    """Information matrix P^-1, lower triangle, (m, m)."""
    factor: Matrix
    """Matrix of the normal equations. After `solve`: its lower Cholesky factor; (m, m)."""
    s: Vector
    """Regressors of the sample, divided by their typical sizes, (m,)."""
    move: Vector
    """Right-hand side of the normal equations. After `solve`: their solution; (m,)."""


def step(
    parameters: CompositeParameters,
    state: CompositeState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Update P^-1, and integrate theta over one sample period by the implicit Euler method."""
    per_size, theta, move = parameters.per_size, state.theta, state.move
    error, filtered_error = filter_errors(parameters, state, phi, f, dt)
    accumulate(parameters, state, error, filtered_error, dt)
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
    """Filter phi and f. Return the force error and the filtered prediction error, both [N].

    The force error is f - phi' theta. The filtered prediction error is f_W - W' theta, where W and
    f_W are the filtered phi and f. If the norm of the scaled regressors is above `LARGEST`, the
    regressors and the force error of the sample are first reduced by a common factor.
    """
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


def accumulate(
    parameters: CompositeParameters,
    state: CompositeState,
    error: float,
    filtered_error: float,
    dt: float,
) -> None:
    """Update the information matrix R, and compute the normal equations of the implicit Euler step.

    R is updated by (8.115) of Slotine and Li, see `CompositeAdaptive`. The matrix of the normal
    equations is R + c s s'. s contains the regressors of this sample, divided by their typical
    sizes. c is the setting `instant` times `dt`, where `dt` is limited to 1 / forgetting rate.
    """
    s, W, R, factor, move = state.s, state.W, state.R, state.factor, state.move
    kept = math.exp(-parameters.forgetting_rate * dt)
    floor = (1.0 - kept) * parameters.floor
    weight = min(dt, 1.0 / parameters.forgetting_rate)
    instant = parameters.instant * weight
    for i in below[len(s)]:
        now = instant * s[i]
        filtered = weight * W[i]
        move[i] = error * now + filtered_error * filtered
        row, factor_row = R[i], factor[i]
        for j in below[i + 1]:
            value = kept * row[j] + filtered * W[j]
            row[j] = value
            factor_row[j] = value + now * s[j]
        row[i] += floor
        factor_row[i] += floor


def solve(parameters: CompositeParameters, state: CompositeState) -> None:
    """Solve the normal equations with the matrix `factor` and the right-hand side `move`.

    `factor` is replaced by its Cholesky factor, and `move` by the solution.
    """
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
        # in exact arithmetic the pivot is at least the floor; rounding may reduce it
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
    """Composite adaptation: theta is adapted by the force error and a filtered prediction error.

    The method is from J.-J. E. Slotine and W. Li, "Applied Nonlinear Control", 1991, sections 8.7
    and 8.8. K. Hashtrudi-Zaad and S. E. Salcudean, "Adaptive transparent impedance reflecting
    teleoperation", IEEE International Conference on Robotics and Automation, 1996, apply the method
    to the environment of a teleoperator. Let W be the regressors and f_W the force, both filtered
    by a first-order lag. Then

        d theta / dt = P (W (f_W - W' theta) + instant phi (f - phi' theta)),
        d(P^-1) / dt = -lambda (P^-1 - P_0^-1) + W W'.

    In the published method, theta is adapted by the error of a force controller and by the filtered
    prediction error f_W - W' theta. Here the force error f - phi' theta replaces the error of the
    force controller.

    The second equation is (8.115) of Slotine and Li. P never exceeds its initial value P_0. The
    forgetting rate lambda is constant. So the estimate of k follows changes of the stiffness even
    during a motion without information on b. With a variable rate lambda (1 - |P| / |P_0|), there
    would be no forgetting during such a motion.

    Let theta_0 be the true parameters. If they are constant and there is no noise, the function
    V = (theta - theta_0)' P^-1 (theta - theta_0) never increases. The implicit Euler method has
    this property for all settings and every `dt`.

    There are no standard deviations, because the filter makes the noise correlated.

    Parameters
    ----------
    forgetting_rate
        Forgetting rate lambda [1/s].
    sizes
        Typical root mean square of each regressor, [m/s] for v, [m] for x. An approximate value is
        sufficient: a regressor may be 0.1 to 10 times its typical size.
    bandwidth
        Bandwidth of the filter [1/s].
    instant
        Weight of the force error, relative to the filtered prediction error, >= 0.
    bound
        Each diagonal element of P_0, in units of lambda / size^2. In these units, P is about 1
        while the motion excites all regressors.
    model
        Model that defines the regressors.

    Raises
    ------
    ValueError
        An argument is out of its range.
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
