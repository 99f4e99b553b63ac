"""Multi-estimator with an adaptive grid of candidates (b, k).

The estimate is the candidate that fits the recent samples best. The grid is coarse at the start.
It is moved such that the best candidate is in the middle, and then it is refined.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from estimation.checks import check_correlation, check_positive
from estimation.estimator import UNKNOWN, Estimator
from estimation.method_settings import SIZES, MethodSettings
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
"""Weight of the term that decides between candidates with equal signals, see `MultiEstimator`.

This weight is smaller than in `MultiEstimator`, because the grid may be narrow and far from zero.
"""
FINEST = 1e-9
"""Smallest spacing of the candidates, as a fraction of the initial spacing."""
COARSEST = 1e100
"""Largest spacing of the candidates, in the unit of the parameter."""
FORGETTING = 1.25
"""Forgetting rate of `me_moving`, in units of the forgetting rate of `me`.

The settling time (see `benchmarks/tuning.py`) is 0.29 s, and 0.31 s for 0.8 times this value.
"""
PATIENCE = 0.5
"""Time after which `me_moving` halves the spacing of its grid, in units of the memory.

The spacing is halved if the best candidate was not at the edge of the grid during this time. The
settling time is 0.29 s for this value, and also for 0.1 times and 2 times this value. The settling
time is 0.94 s for 10 times this value.
"""
FIRST_SPACING_B = 1.0 / 40.0
"""Initial spacing of b in `me_moving`, in units of typical force / typical velocity.

The grid has 16 values of b on either side of zero. So the initial grid extends to 0.4 times typical
force / typical velocity. The spacing is then adapted, so that 0.1 and 10 times this value give the
same result.
"""
FIRST_SPACING_K = 0.25
"""Initial spacing of k in `me_moving`, in units of typical force / typical displacement.

The grid has 16 values of k on either side of zero. So the initial grid extends to 4 times typical
force / typical displacement. The spacing is then adapted, so that 0.1 and 10 times this value give
the same result.
"""


@dataclass(frozen=True, slots=True)
class CoarseToFineParameters:
    """Constant settings of the estimator `CoarseToFine`, which `step` reads."""

    twice_lambda: float
    """Rate at which the weight of a sample decays [1/s]."""
    half: float
    """Number of candidate values on either side of the middle value of an axis."""
    patience: float
    """The spacing is halved if no selected value was at the edge during this time [s]."""
    correlation: float
    """Correlation length of the force noise, in samples, >= 1."""
    finest_b: float
    """Smallest spacing of b [N s/m]."""
    finest_k: float
    """Smallest spacing of k [N/m]."""


@dataclass(slots=True)
class CoarseToFineState(MonitoringState):
    """Variables of the estimator `CoarseToFine`, which `step` updates at each sample.

    The fields `b` and `k` are the candidate values of the damping and of the stiffness.
    """

    b: MovingAxis
    k: MovingAxis


def step(
    parameters: CoarseToFineParameters,
    state: CoarseToFineState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Select the candidate with the smallest monitoring signal, and adapt the grid of candidates.

    The monitoring signal of a candidate (b, k) is the exponentially weighted integral of the
    squared force error (b v + k x - f)^2. The grid has one axis with the candidate values of b, and
    one axis with those of k. Both axes are adapted.
    """
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
    """Adapt one axis of the grid, which contains the candidate values of b or of k.

    If the selected value is at the edge of the axis, the spacing of the axis is doubled. If no
    selected value was at the edge during the time `patience`, the spacing is halved. In both cases,
    the middle of the axis is moved to the selected value.

    The spacing is not halved if the new spacing would be below one of three limits:

    - `finest`;
    - a quarter of sqrt(spread) / curvature. This is the standard deviation that the parameter would
      have if the other parameter were known;
    - sqrt(tie / curvature) / half, where `half` is the number of values on either side of the
      middle. Below this limit, the term that decides between equal candidates could change the
      result (`least_candidate`).

    `finest` is the smallest spacing. Along this axis, the monitoring signal increases by
    `curvature` d^2 from its minimum to the distance d. `spread` is the variance of the weighted sum
    of the regressor times the force noise. `tie` is the smallest permitted increase of the
    monitoring signal [N^2 s] from the middle to the edge.
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
    """Set the spacing of an axis, and move the middle of the axis to the value middle * spacing.

    `middle` is an integer. `half` is the number of candidate values on either side of the middle.
    """
    axis.middle = middle
    axis.spacing = spacing
    axis.first = (middle - half) * spacing
    axis.zero = min(max(half - middle, 0.0), 2.0 * half)
    axis.span = 2.0 * half * spacing
    axis.settled = 0.0


def moving_axis(half: int, spacing: float) -> MovingAxis:
    """Return an axis with the candidate value zero and `half` values on either side of zero.

    `spacing` is the distance between adjacent values.
    """
    last = 2 * half
    axis = MovingAxis(0.0, 0.0, last, 0.0, 0.0, 1.0 / (last * last), 0.0, 0.0)
    place(axis, half, 0.0, spacing)
    return axis


class CoarseToFine(Estimator):
    """Multi-estimator whose grid of candidates (b, k) is moved and refined during the estimation.

    The method is defined by equations (10) and (11) of the paper (Yamamoto et al., 2008). The
    estimate is the candidate with the smallest monitoring signal, which is the exponentially
    weighted integral of the squared force error (b v + k x - f)^2. The monitoring signal is a
    quadratic function of (b, k). Its six coefficients are sums over the samples that do not depend
    on the grid. So no information is lost when the grid moves.

    The grid has an axis for b and an axis for k. At each sample, both axes are adapted separately.
    If the selected value is at the edge of its axis, the spacing of this axis is doubled. If the
    selected value was not at the edge during the time `patience`, the spacing is halved. In both
    cases, the middle of the axis is moved to the selected value. The spacing decreases until it is
    at most about an eighth of the width of the 95 % confidence interval.

    All candidate values are integer multiples of the spacing. So if the range of an axis contains
    zero, zero is a candidate value. If several candidates have equal signals, the candidate nearest
    to (0, 0) is selected, as in `MultiEstimator`.

    A parameter that the data do not determine has the standard deviation `UNKNOWN` (1e12).

    Parameters
    ----------
    forgetting_rate
        Forgetting rate lambda in equation (11) [1/s], >= 0. The weight of a squared force error
        decays as e^(-2 lambda t).
    patience
        The spacing of an axis is halved if the selected value was not at the edge of the axis
        during this time [s], > 0.
    spacing
        Initial distance between adjacent values of b [N s/m] and of k [N/m]. The result hardly
        depends on it, because the spacing is adapted.
    half
        Number of candidate values on either side of the middle value, on each axis.
    correlation
        Correlation length of the force noise, in samples, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    used_settings = ("forgetting", "forgetting_rate", *SIZES)
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
        check_positive(patience=patience)
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

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            FORGETTING * settings.forgetting_rate,
            PATIENCE * settings.memory,
            (
                FIRST_SPACING_B * settings.f_size / settings.v_size,
                FIRST_SPACING_K * settings.f_size / settings.x_size,
            ),
            correlation=settings.correlation,
        )

    @property
    def grid(self) -> Grid:
        """The grid of candidates (b, k) after the latest sample."""
        half = self.parameters.half
        b, k = (
            Axis(axis.first, (axis.middle + half) * axis.spacing, axis.last + 1)
            for axis in (self.state.b, self.state.k)
        )
        return Grid(b, k)
