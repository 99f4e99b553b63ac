"""Multi-estimator whose grid is coarse at the start, follows the best candidate, and is refined."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.checks import check_correlation
from estimation.estimator import UNKNOWN, Estimator
from estimation.methods.candidates import MovingAxis, least_candidate
from estimation.methods.grid import Axis, Grid
from estimation.methods.monitoring import (
    NO_SUMS,
    MonitoringState,
    decay_and_add,
    deviation,
    least_point,
    monitoring_signal,
)
from estimation.methods.multi_estimator import FASTEST
from estimation.step import B, K, Regressors

TIE = 1e-12
"""Weight of the tie-breaking term, see `MultiEstimator`.

This weight is smaller than in `MultiEstimator`, because the grid may be narrow and far from zero.
"""
FINEST = 1e-9
"""Smallest spacing of the candidates, as a fraction of the initial spacing."""
COARSEST = 1e100
"""Largest spacing of the candidates, in the unit of the parameter."""


@dataclass(frozen=True, slots=True)
class CoarseToFineParameters:
    """Constant settings of the function `step`."""

    twice_lambda: float
    """Rate at which the weight of a sample decays [1/s]."""
    half: float
    """Number of candidate values on either side of the middle value of an axis."""
    patience: float
    """The spacing is halved if no best candidate was at the edge during this time [s]."""
    correlation: float
    """Number of samples per independent value of the force noise, >= 1."""
    finest_b: float
    """Smallest spacing of b [N s/m]."""
    finest_k: float
    """Smallest spacing of k [N/m]."""


@dataclass(slots=True)
class CoarseToFineState(MonitoringState):
    """Variables that the function `step` updates."""

    b: MovingAxis
    k: MovingAxis


def step(
    parameters: CoarseToFineParameters,
    state: CoarseToFineState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Select the candidate with the smallest monitoring signal, and adapt both axes of the grid."""
    v, x = phi
    decay_and_add(parameters.twice_lambda, state, v, x, f, dt)
    b, k = least_candidate(state, state.b, state.k, TIE)
    state.theta[B], state.theta[K] = b, k
    b_free, k_free, b_variance, k_variance = least_point(parameters.correlation, state)
    state.std[B] = deviation(b_variance, b_free - b, UNKNOWN)
    state.std[K] = deviation(k_variance, k_free - k, UNKNOWN)
    noise = parameters.correlation * monitoring_signal(state, b, k) / state.weights
    tie = 100.0 * TIE * state.ff
    follow(parameters, state.b, b, parameters.finest_b, state.vv, noise * state.q_vv, tie, dt)
    follow(parameters, state.k, k, parameters.finest_k, state.xx, noise * state.q_xx, tie, dt)


def follow(
    parameters: CoarseToFineParameters,
    axis: MovingAxis,
    value: float,
    finest: float,
    curvature: float,
    spread: float,
    tie: float,
    dt: float,
) -> None:
    """Adapt one axis of the grid to `value`, the selected value of its parameter.

    If `value` is at the edge of the axis, the spacing is doubled. If `value` was not at the edge
    during the time `patience`, the spacing is halved. In both cases, the middle of the axis is
    moved to `value`.

    The spacing is halved only if the new spacing is not below any of three limits:

    - The first limit is the setting `finest`.
    - The second limit is a quarter of the standard deviation that the parameter would have if the
      other parameter were known. This standard deviation is sqrt(spread) / curvature.
    - The third limit makes sure that the tie-breaking term does not change the result. At a
      distance d from the minimum of the monitoring signal, the signal is larger than the minimum by
      `curvature` d^2. At the third limit, this difference is `tie` if d is the distance from the
      middle to the edge of the axis.
    """
    half, spacing = parameters.half, axis.spacing
    if abs(value - axis.middle * spacing) > (half - 0.5) * spacing:
        if spacing < COARSEST:
            spacing *= 2.0
    else:
        axis.settled += dt
        if axis.settled < parameters.patience:
            return
        finer = 0.5 * spacing
        slope, reach = 4.0 * finer * curvature, half * finer
        if finer >= finest and slope * slope >= spread and reach * reach * curvature >= tie:
            spacing = finer
    place(axis, half, float(math.floor(value / spacing + 0.5)), spacing)


def place(axis: MovingAxis, half: float, middle: float, spacing: float) -> None:
    """Set the spacing of an axis, and move the middle of the axis to the value middle * spacing."""
    axis.middle = middle
    axis.spacing = spacing
    axis.first = (middle - half) * spacing
    axis.zero = min(max(half - middle, 0.0), 2.0 * half)
    axis.span = 2.0 * half * spacing
    axis.settled = 0.0


def moving_axis(half: int, spacing: float) -> MovingAxis:
    """Return the initial axis, which has `half` values on either side of zero, at this spacing."""
    last = 2 * half
    axis = MovingAxis(0.0, 0.0, last, 0.0, 0.0, 1.0 / (last * last), 0.0, 0.0)
    place(axis, half, 0.0, spacing)
    return axis


class CoarseToFine(Estimator):
    """Multi-estimator, equations (10) and (11) of the paper, with a grid that moves.

    The monitoring signals of all candidates are one quadratic function of (b, k). Its six
    coefficients are sums that do not depend on the grid. So no information is lost when the grid
    moves.

    The axes of b and k are adapted separately at each sample. If the selected value is at the edge
    of its axis, the spacing of this axis is doubled. If the selected value was not at the edge
    during the time `patience`, the spacing is halved. In both cases, the middle of the axis is
    moved to the selected value. The spacing decreases until it is at most an eighth of the width of
    the 95 % confidence interval.

    All candidate values are integer multiples of the spacing. So zero is either a candidate or
    outside of the grid. If several candidates have equal signals, the candidate nearest to zero is
    selected as in `MultiEstimator`.

    A parameter that the data do not determine has the standard deviation `UNKNOWN`.

    Parameters
    ----------
    forgetting_rate
        lambda in equation (11) [1/s], >= 0. The weight of a squared error decays as
        e^(-2 lambda t).
    patience
        The spacing is halved if no best candidate was at the edge during this time [s], > 0.
    spacing
        Initial spacing of b [N s/m] and k [N/m]. It has little effect on the result.
    half
        Number of candidates on either side of the middle candidate, along each axis.
    correlation
        Number of samples per independent value of the force noise, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    parameters: CoarseToFineParameters
    state: CoarseToFineState

    def __init__(
        self,
        forgetting_rate: float,
        patience: float = 0.02,
        spacing: tuple[float, float] = (10.0, 500.0),
        half: int = 16,
        correlation: float = 1.0,
    ) -> None:
        if not 0.0 <= forgetting_rate <= FASTEST:
            raise ValueError(
                f"forgetting rate must be between 0 and {FASTEST:g}/s, got {forgetting_rate}"
            )
        if not 0.0 < patience < math.inf:
            raise ValueError(f"patience must be positive, got {patience}")
        if len(spacing) != 2 or not all(1e-30 <= value <= 1e30 for value in spacing):
            raise ValueError(f"spacing must be two positive numbers, for b and k, got {spacing}")
        if not 2 <= half <= 10_000 or half != int(half):
            raise ValueError(f"half the grid must be 2 to 10000 candidates, got {half}")
        check_correlation(correlation)
        b_step, k_step = spacing
        super().__init__(
            CoarseToFineParameters(
                twice_lambda=2.0 * forgetting_rate,
                half=float(half),
                patience=patience,
                correlation=correlation,
                finest_b=FINEST * b_step,
                finest_k=FINEST * k_step,
            ),
            CoarseToFineState(
                [0.0, 0.0],
                [UNKNOWN, UNKNOWN],
                False,
                *NO_SUMS,
                moving_axis(int(half), b_step),
                moving_axis(int(half), k_step),
            ),
        )

    @property
    def grid(self) -> Grid:
        """The present grid."""
        half = self.parameters.half
        b, k = (
            Axis(axis.first, (axis.middle + half) * axis.spacing, axis.last + 1)
            for axis in (self.state.b, self.state.k)
        )
        return Grid(b, k)
