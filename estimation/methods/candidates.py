"""The candidate of least monitoring signal out of a grid of candidates (b, k)."""

from __future__ import annotations

from dataclasses import dataclass

from estimation.methods.grid import Axis
from estimation.methods.lattice import least_in_box
from estimation.methods.monitoring import MonitoringState


@dataclass(frozen=True, slots=True)
class GridAxis:
    """The candidate values of one parameter."""

    first: float
    """The first value."""
    spacing: float
    """Distance between neighbours."""
    last: int
    """Index of the last value."""
    zero: float
    """Index of the value nearest zero."""
    span: float
    """From the first value to the last."""
    per_square: float
    """1 / last^2."""


@dataclass(slots=True)
class MovingAxis:
    """The present candidate values of one parameter, as a `GridAxis`, and where they move."""

    first: float
    spacing: float
    last: int
    zero: float
    span: float
    per_square: float
    middle: float
    """The middle value, in units of the spacing."""
    settled: float
    """For how long the winner has not been at the edge [s]."""


def least_candidate(
    state: MonitoringState, b: GridAxis | MovingAxis, k: GridAxis | MovingAxis, share: float
) -> tuple[float, float]:
    """The candidate (b, k) of least monitoring signal.

    The tie-breaking term is a `share` of the signal that the grid spans.
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
    """An axis as a step needs it."""
    last = axis.count - 1
    zero = float(axis.nearest_zero)
    return GridAxis(axis.first, axis.spacing, last, zero, axis.spacing * last, 1.0 / (last * last))
