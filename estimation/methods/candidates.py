"""Search a grid of candidates (b, k) for the candidate with the smallest monitoring signal."""

from __future__ import annotations

from dataclasses import dataclass

from estimation.methods.grid import Axis
from estimation.methods.lattice import least_in_box
from estimation.methods.monitoring import MonitoringState


@dataclass(frozen=True, slots=True)
class GridAxis:
    """Candidate values of one parameter, in the unit of the parameter."""

    first: float
    """First value."""
    spacing: float
    """Distance between adjacent values."""
    last: int
    """Index of the last value."""
    zero: float
    """Index of the value nearest to zero."""
    span: float
    """Distance from the first to the last value."""
    per_square: float
    """1 / last^2."""


@dataclass(slots=True)
class MovingAxis:
    """Candidate values of one parameter. The values change over time.

    `GridAxis` describes the first six fields.
    """

    first: float
    spacing: float
    last: int
    zero: float
    span: float
    per_square: float
    middle: float
    """Middle candidate value, in units of the spacing."""
    settled: float
    """Time since the values last changed [s]. No best candidate was at the edge in this time."""


def least_candidate(
    state: MonitoringState, b: GridAxis | MovingAxis, k: GridAxis | MovingAxis, share: float
) -> tuple[float, float]:
    """Return the candidate (b, k) with the smallest monitoring signal.

    A small term with the weight `share` is added to the signals, so that one candidate is selected
    if several signals are equal. `MultiEstimator` defines this term.
    """
    vv, vx, xx = state.vv, state.vx, state.xx
    b_first, b_step = b.first, b.spacing
    k_first, k_step = k.first, k.spacing
    spanned = state.ff + b.span * b.span * vv + k.span * k.span * xx
    tie = share * spanned + 1e-100
    b_tie, k_tie = tie * b.per_square, tie * k.per_square
    i, j = least_in_box(
        b_step * b_step * vv + b_tie,
        b_step * k_step * vx,
        k_step * k_step * xx + k_tie,
        b_step * (b_first * vv + k_first * vx - state.fv) - b_tie * b.zero,
        k_step * (b_first * vx + k_first * xx - state.fx) - k_tie * k.zero,
        b.last,
        k.last,
    )
    return b_first + i * b_step, k_first + j * k_step


def grid_axis(axis: Axis) -> GridAxis:
    """Convert an `Axis` to a `GridAxis` for the function `least_candidate`."""
    last = axis.count - 1
    zero = float(axis.nearest_zero)
    return GridAxis(axis.first, axis.spacing, last, zero, axis.spacing * last, 1.0 / (last * last))
