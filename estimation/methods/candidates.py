"""Search a grid of candidates (b, k) for the candidate with the smallest monitoring signal.

The monitoring signal of a candidate is the exponentially weighted integral of the squared force
error (b v + k x - f)^2, equation (11) of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass

from estimation.methods.grid import Axis
from estimation.methods.lattice import least_in_box
from estimation.methods.monitoring import MonitoringState


@dataclass(frozen=True, slots=True)
class GridAxis:
    """Evenly spaced candidate values of one parameter, b [N s/m] or k [N/m]."""

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
    """1 / last^2, a factor of the term that decides between candidates with equal signals."""


@dataclass(slots=True)
class MovingAxis:
    """Evenly spaced candidate values of one parameter, b or k, which change during the estimation.

    The first six fields are the same as in `GridAxis`, and are described there.
    """

    first: float
    spacing: float
    last: int
    zero: float
    span: float
    per_square: float
    middle: float
    """Middle candidate value divided by the spacing; an integer."""
    settled: float
    """Time since the axis was last adapted by the function `place` [s]. In this time, the selected
    value was never at the edge of the axis."""


def least_candidate(
    state: MonitoringState, b: GridAxis | MovingAxis, k: GridAxis | MovingAxis, share: float
) -> tuple[float, float]:
    """Return the candidate (b, k) with the smallest monitoring signal.

    The monitoring signal of a candidate is the exponentially weighted integral of the squared force
    error (b v + k x - f)^2. If several candidates have equal signals, the candidate nearest to
    (0, 0) is selected. For this purpose, a small term is added to each signal. `MultiEstimator`
    defines this term.
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
    """Convert an `Axis` to a `GridAxis`, the form that the function `least_candidate` needs."""
    last = axis.count - 1
    zero = float(axis.nearest_zero)
    return GridAxis(axis.first, axis.spacing, last, zero, axis.spacing * last, 1.0 / (last * last))
