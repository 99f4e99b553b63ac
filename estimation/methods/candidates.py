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
    last: float
    """Index of the last value."""
    zero: float
    """Index of the value nearest zero."""


@dataclass(slots=True)
class MovingAxis:
    """The present candidate values of one parameter, as a `GridAxis`, and where they move."""

    first: float
    spacing: float
    last: float
    zero: float
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
    b_first, b_step, b_last = b.first, b.spacing, b.last
    k_first, k_step, k_last = k.first, k.spacing, k.last
    b_curvature = b_step * b_step * vv
    k_curvature = k_step * k_step * xx
    tie = (
        share * (state.ff + b_curvature * b_last * b_last + k_curvature * k_last * k_last) + 1e-100
    )
    b_tie = tie / (b_last * b_last)
    k_tie = tie / (k_last * k_last)
    i, j = least_in_box(
        b_curvature + b_tie,
        b_step * k_step * vx,
        k_curvature + k_tie,
        b_step * (b_first * vv + k_first * vx - state.fv) - b_tie * b.zero,
        k_step * (b_first * vx + k_first * xx - state.fx) - k_tie * k.zero,
        int(b_last),
        int(k_last),
    )
    return b_first + i * b_step, k_first + j * k_step


def grid_axis(axis: Axis) -> GridAxis:
    """An axis as `step` needs it."""
    return GridAxis(axis.first, axis.spacing, float(axis.count - 1), float(axis.nearest_zero))
