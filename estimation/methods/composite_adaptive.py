"""Composite adaptation (CA): estimator that uses a force error and a filtered prediction error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from estimation.checks import check_positive, positive_values
from estimation.estimator import Estimator
from estimation.method_settings import SIZES, MethodSettings
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, State, Vector, below, diagonal, zeros

LARGEST = 10.0
"""Largest norm of the vector of regressors, each divided by its typical size.

In a sample with a larger norm, the regressors and the force are divided by a common factor.
"""
FORGETTING = 2.0
"""Forgetting rate of `composite`, in units of 1 / memory.

The settling time (see `benchmarks/tuning.py`) is 0.24 s, and 0.28 s for 0.8 times this value.
"""
BANDWIDTH = 5.0
"""Bandwidth of the filter of `composite`, in units of 1 / memory.

The settling time for 0.5 times this value and that for 2 times this value differ by 0.01 s.
"""


@dataclass(frozen=True, slots=True)
class CompositeParameters:
    """Constant settings of the estimator `CompositeAdaptive`, which `step` reads."""

    bandwidth: float
    """Bandwidth of the low-pass filter of phi and f [1/s]."""
    forgetting_rate: float
    """Forgetting rate lambda [1/s]."""
    instant: float
    """Weight of the force error f - phi' theta, relative to the filtered prediction error."""
    floor: float
    """Value of each diagonal element of the initial information matrix P_0^-1, for regressors
    divided by their sizes."""
    per_size: tuple[float, ...]
    """1 / typical size of each regressor, (m,)."""


@dataclass(slots=True)
class CompositeState(State):
    """Variables of the estimator `CompositeAdaptive`, which `step` updates at each sample.

    All regressors in these variables are divided by their typical sizes.
    """

    W: Vector
    """Filtered regressors, (m,)."""
    force: float
    """Filtered force f_W [N]."""
    R: Matrix
    """Information matrix P^-1, lower triangle, (m, m)."""
    factor: Matrix
    """Matrix of the linear equations. `solve` replaces it by its lower Cholesky factor; (m, m)."""
    s: Vector
    """Regressors of the sample, divided by their typical sizes, (m,)."""
    move: Vector
    """Right-hand side of the linear equations. `solve` replaces it by their solution; (m,)."""


def step(
    parameters: CompositeParameters,
    state: CompositeState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Update theta and the information matrix P^-1 with one sample.

    `CompositeAdaptive` defines the differential equations of theta and P^-1. They are integrated
    over one sample period: first the equation of P^-1, and then the equation of theta by the
    implicit Euler method.
    """
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
    """Filter phi and f, and compute the force error and the filtered prediction error.

    phi is first divided by the typical sizes of the regressors. If the norm of the result is above
    `LARGEST`, the regressors and the force of the sample are divided by a common factor, so that
    the norm is equal to `LARGEST`.

    The result is f - phi' theta and f_W - W' theta [N], both after the division.
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
    """Update the information matrix P^-1, and compute the equations of the implicit Euler step.

    P^-1 is stored in `R`. It is updated by the second differential equation in `CompositeAdaptive`.
    The change of theta in an implicit Euler step is the solution of linear equations. Their
    matrix, R + c s s', is stored in `factor`, and their right-hand side is stored in `move`. s
    contains the regressors of this sample, divided by their typical sizes. c is the setting
    `instant` times `dt`, where `dt` is limited to 1 / forgetting rate.
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
    """Solve the linear equations with the matrix `factor` and the right-hand side `move`.

    Their solution is the change of the scaled parameters in this sample. It replaces `move`. The
    Cholesky factor of the matrix replaces `factor`.
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

    The model is f = phi' theta. Let W be the regressors phi and f_W the force f, both filtered by a
    first-order low-pass. Then

        d theta / dt = P (W (f_W - W' theta) + instant phi (f - phi' theta)),
        d(P^-1) / dt = -lambda (P^-1 - P_0^-1) + W W'.

    f - phi' theta is the force error, and f_W - W' theta is the filtered prediction error. The
    weight `instant` and the forgetting rate lambda are settings.

    The method is from J.-J. E. Slotine and W. Li, "Applied Nonlinear Control", 1991, sections 8.7
    and 8.8. The second equation is their equation (8.115). K. Hashtrudi-Zaad and S. E. Salcudean,
    "Adaptive transparent impedance reflecting teleoperation", IEEE International Conference on
    Robotics and Automation, 1996, apply the method to the environment of a teleoperator. In the
    published method, theta is adapted by the error of a force controller and by the filtered
    prediction error. Here the force error replaces the error of the force controller.

    P never exceeds its initial value P_0. The forgetting rate lambda is constant. So the estimate
    of k follows changes of the stiffness even during a motion without information on b. With the
    variable rate lambda (1 - |P| / |P_0|), there would be no forgetting during such a motion.

    Let theta_0 be the true parameters. If they are constant and there is no noise, the function
    V = (theta - theta_0)' P^-1 (theta - theta_0) never increases. In discrete time, this is also
    true for all settings and every `dt`, because the implicit Euler method is used.

    The standard deviations are NaN, because the filter makes the noise correlated.

    Parameters
    ----------
    forgetting_rate
        Forgetting rate lambda [1/s].
    sizes
        Typical root mean square of each regressor, [m/s] for v, [m] for x. An approximate value is
        sufficient: a regressor may be 0.1 to 10 times its typical size.
    bandwidth
        Bandwidth of the low-pass filter [1/s].
    instant
        Weight of the force error, relative to the filtered prediction error, >= 0.
    bound
        Each diagonal element of P_0, in units of lambda / size^2. In these units, P is about 1
        while the motion excites all regressors.
    model
        Model f = phi' theta that defines the regressors phi.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    used_settings = ("forgetting", *SIZES)

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
        check_positive(forgetting_rate=forgetting_rate, bandwidth=bandwidth)
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

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        memory = settings.memory
        return cls(FORGETTING / memory, settings.sizes, BANDWIDTH / memory, model=settings.model)
