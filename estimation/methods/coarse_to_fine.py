"""Coarse to fine: a multi-estimator whose grid follows the winner, so that none need be given."""

from __future__ import annotations

import math

from estimation.checks import check_correlation
from estimation.compiled import Parameters, Regressors, State
from estimation.estimator import UNKNOWN, Estimator
from estimation.methods.grid import Axis, Grid
from estimation.methods.multi_estimator import (
    FASTEST,
    MultiEstimator,
    decay_and_add,
    deviations,
    least_candidate,
)

B_AXIS, K_AXIS = 17, 20
"""Where each axis is in the state: its middle in units of its spacing, its spacing, and for how
long [s] the winner has not been at its edge."""
TIE = 1e-12
"""As the multi-estimator's; less, since this grid may be narrow and far from zero."""
FINEST = 1e-9
"""Least spacing, as a share of the first."""
COARSEST = 1e100
"""Largest spacing."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Take the candidate of least (11) out of the present grid, and let the grid follow it."""
    half, patience, correlation = parameters[1], parameters[2], parameters[3]
    decay_and_add(parameters[0], state, phi[0], phi[1], f, dt)
    b_middle, b_step = state[B_AXIS], state[B_AXIS + 1]
    k_middle, k_step = state[K_AXIS], state[K_AXIS + 1]
    last = 2.0 * half
    state[0], state[1] = least_candidate(
        state,
        (b_middle - half) * b_step,
        b_step,
        last,
        min(max(half - b_middle, 0.0), last),
        (k_middle - half) * k_step,
        k_step,
        last,
        min(max(half - k_middle, 0.0), last),
        TIE,
    )
    state[2], state[3] = deviations(correlation, state, UNKNOWN, UNKNOWN, dt)
    b, k = state[0], state[1]
    mu = state[5] + b * (b * state[8] - 2.0 * state[6]) + k * (k * state[10] - 2.0 * state[7])
    noise = correlation * max(mu + 2.0 * b * k * state[9], 0.0) / state[14]
    tie = 100.0 * TIE * state[5]
    follow(state, B_AXIS, b, half, patience, parameters[4], tie, state[8], noise * state[11], dt)
    follow(state, K_AXIS, k, half, patience, parameters[5], tie, state[10], noise * state[13], dt)


def follow(
    state: State,
    axis: int,
    value: float,
    half: float,
    patience: float,
    finest: float,
    tie: float,
    curvature: float,
    spread: float,
    dt: float,
) -> None:
    """Double the spacing about a winner at the edge; after `patience` away from it, halve it.

    It is not halved below a quarter of the deviation that the parameter would have were the
    other one known, sqrt(spread) / curvature, nor so far that the tie-breaking term would
    count: the signal grows by `tie` or more from middle to edge.
    """
    middle, spacing = state[axis], state[axis + 1]
    if abs(value - middle * spacing) > (half - 0.5) * spacing:
        if spacing < COARSEST:
            spacing *= 2.0
    else:
        state[axis + 2] += dt
        if state[axis + 2] < patience:
            return
        finer = 0.5 * spacing
        slope, reach = 4.0 * finer * curvature, half * finer
        if finer >= finest and slope * slope >= spread and reach * reach * curvature >= tie:
            spacing = finer
    state[axis] = math.floor(value / spacing + 0.5)
    state[axis + 1] = spacing
    state[axis + 2] = 0.0


class CoarseToFine(Estimator):
    """The candidate of least monitoring signal, (10)-(11), out of a grid that follows it.

    Monitoring signals of all candidates are one quadratic form, known from six sums wherever
    the grid is, so nothing is lost by moving it. Where the winner lies at the grid's edge, the
    grid moves there and its spacing doubles, in each sample anew; where it has not for some
    time, the grid moves to the winner and its spacing halves, down to an eighth of the 95 %
    interval or less. Candidates are whole multiples of the spacing, so zero is always one of
    them or beyond the edge, and ties are broken as in `MultiEstimator`.

    A parameter of which the data says nothing has the standard deviation `UNKNOWN`.

    Parameters
    ----------
    forgetting_rate
        lambda in (11) [1/s], >= 0: a squared error's weight falls as e^(-2 lambda t).
    patience
        Time [s] away from the edge after which the grid narrows, > 0.
    spacing
        Of the first grid, for b [N s/m] and k [N/m]. It hardly matters.
    half
        Candidates to either side of the middle one, along each axis.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    step = staticmethod(step)
    gated = True
    helpers = (*MultiEstimator.helpers, follow)

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
            (
                2.0 * forgetting_rate,
                half,
                patience,
                correlation,
                FINEST * b_step,
                FINEST * k_step,
            ),
            (0.0, 0.0, UNKNOWN, UNKNOWN, *[0.0] * 13, 0.0, b_step, 0.0, 0.0, k_step, 0.0),
        )

    @property
    def grid(self) -> Grid:
        """Where the grid is now."""
        half = self.parameters[1]
        b, k = (
            Axis((middle - half) * spacing, (middle + half) * spacing, int(2.0 * half) + 1)
            for middle, spacing in (self.state[at : at + 2] for at in (B_AXIS, K_AXIS))
        )
        return Grid(b, k)
