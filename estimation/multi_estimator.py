"""The multi-estimator (ME): the candidate (b, k) of least monitoring signal, out of a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats, State
from estimation.estimator import Estimates, Estimator
from estimation.lattice import inside, least_in_box, lowest_on_border

Indices = NDArray[np.int64]

TIE = 1e-9
"""Weight of the tie-breaking term, as a share of the monitoring signal that the grid spans."""
FASTEST = 1e6
"""Largest forgetting rate [1/s]."""
MOST = 10**8
"""Most candidates along one axis."""


@dataclass(frozen=True)
class Axis:
    """Evenly spaced candidate values of one parameter, from `first` to `last`.

    Raises
    ------
    ValueError
        Fewer than two values, or values that do not rise.
    """

    first: float
    last: float
    count: int

    def __post_init__(self) -> None:
        if not -math.inf < self.first < self.last < math.inf:
            raise ValueError(f"candidates must rise, got {self.first} to {self.last}")
        if not 2 <= self.count <= MOST or self.count != int(self.count):
            raise ValueError(
                f"an axis needs at least two candidates and at most {MOST:g}, got {self.count}"
            )

    @property
    def spacing(self) -> float:
        """Distance between neighbours."""
        return (self.last - self.first) / (self.count - 1)

    @property
    def values(self) -> Floats:
        """All candidate values, shape (count,)."""
        return self.first + self.spacing * np.arange(self.count, dtype=np.float64)

    @property
    def nearest_zero(self) -> int:
        """Index of the value of least magnitude, the lower of two."""
        wanted = math.ceil(-self.first / self.spacing - 0.5)
        return min(max(wanted, 0), self.count - 1)


@dataclass(frozen=True)
class Grid:
    """The candidates: every pair of a damping [N s/m] and a stiffness [N/m]."""

    b: Axis
    k: Axis

    @property
    def candidates(self) -> int:
        """How many there are."""
        return self.b.count * self.k.count


def step(parameters: State, state: State, v: float, x: float, f: float, dt: float) -> State:
    """Let the six sums decay, add the sample, and take the candidate of least (11).

    With the force error held over `dt`, (11) is exactly mu <- e^(-2 lambda dt) mu + w e^2
    with w = (1 - e^(-2 lambda dt)) / 2 lambda. Its e^2 = (b v + k x - f)^2 opens into
    products of (f, v, x), whose sums so decayed give mu of every candidate at once.
    """
    twice_lambda, b_first, b_step, b_last, b_zero, k_first, k_step, k_last, k_zero = parameters
    _, _, ff, fv, fx, vv, vx, xx = state
    loss = -math.expm1(-twice_lambda * dt)
    decay = 1.0 - loss
    weight = loss / twice_lambda if twice_lambda > 0.0 else dt
    ff = ff * decay + weight * f * f
    fv = fv * decay + weight * f * v
    fx = fx * decay + weight * f * x
    vv = vv * decay + weight * v * v
    vx = vx * decay + weight * v * x
    xx = xx * decay + weight * x * x

    b_curvature = b_step * b_step * vv
    k_curvature = k_step * k_step * xx
    tie = TIE * (ff + b_curvature * b_last * b_last + k_curvature * k_last * k_last) + 1e-100
    b_tie = tie / (b_last * b_last)
    k_tie = tie / (k_last * k_last)
    i, j = least_in_box(
        b_curvature + b_tie,
        b_step * k_step * vx,
        k_curvature + k_tie,
        b_step * (b_first * vv + k_first * vx - fv) - b_tie * b_zero,
        k_step * (b_first * vx + k_first * xx - fx) - k_tie * k_zero,
        int(b_last),
        int(k_last),
    )
    return b_first + i * b_step, k_first + j * k_step, ff, fv, fx, vv, vx, xx


class MultiEstimator(Estimator):
    """The candidate of least monitoring signal, the paper's (10)-(11), out of a grid.

    The signals of all candidates are one quadratic form in (b, k), and its least candidate is
    found without visiting the others, so the cost does not grow with the grid.

    Ties are broken by one rule: to the monitoring signal of a candidate is added `TIE` times
    the signal that the grid spans (int f^2 + (b v)^2 + (k x)^2, b and k the axes' lengths),
    times its squared distance from the candidate nearest to (b, k) = (0, 0), in units of the
    axes' lengths. So a damping of which the data says nothing reads as zero, and candidates
    that the data does tell apart are not affected.

    Parameters
    ----------
    grid
        The candidates.
    forgetting_rate
        lambda in (11) [1/s], >= 0: a squared error's weight falls as e^(-2 lambda t).

    Raises
    ------
    ValueError
        The forgetting rate is out of its range.
    """

    step = staticmethod(step)
    helpers = (inside, lowest_on_border, least_in_box)

    def __init__(self, grid: Grid, forgetting_rate: float) -> None:
        if not 0.0 <= forgetting_rate <= FASTEST:
            raise ValueError(
                f"forgetting rate must be between 0 and {FASTEST:g}/s, got {forgetting_rate}"
            )
        self.grid = grid
        parameters = [2.0 * forgetting_rate]
        for axis in (grid.b, grid.k):
            parameters += [axis.first, axis.spacing, axis.count - 1, axis.nearest_zero]
        zero = (axis.first + axis.nearest_zero * axis.spacing for axis in (grid.b, grid.k))
        super().__init__(tuple(parameters), (*zero, *(0.0,) * 6))

    def monitoring_signal(self, b: Floats | float, k: Floats | float) -> Floats:
        """(11) of the candidates (b, k) [N^2 s], arrays that broadcast."""
        ff, fv, fx, vv, vx, xx = self.state[2:]
        b, k = np.asarray(b, dtype=np.float64), np.asarray(k, dtype=np.float64)
        signal = ff + b * (b * vv - 2.0 * fv) + k * (k * xx - 2.0 * fx) + 2.0 * b * k * vx
        return np.maximum(signal, 0.0)

    def ties(self, margin: float) -> Floats:
        """Candidates whose monitoring signal exceeds the winner's by at most `margin` of it.

        Parameters
        ----------
        margin
            Share of the winner's monitoring signal, >= 0.

        Returns
        -------
        Array of shape (n, 2), rows of (b, k), the winner among them.

        Raises
        ------
        ValueError
            The margin is negative.
        """
        first, last = self.tied_rows(margin)
        k = self.grid.k.values
        rows = [
            np.column_stack((np.full(max(0, b_last - b_first + 1), b), k[b_first : b_last + 1]))
            for b, b_first, b_last in zip(self.grid.b.values, first, last, strict=True)
        ]
        return np.concatenate(rows)

    def tied_rows(self, margin: float) -> tuple[Indices, Indices]:
        """Index of the first and of the last k that `ties` has for each b; first > last if none.

        Arrays of shape (grid.b.count,). The cost does not grow with the number of k.
        """
        if not margin >= 0.0:
            raise ValueError(f"margin must be >= 0, got {margin}")
        winner = self.estimate
        ff, fv, fx, vv, vx, xx = self.state[2:]
        rounding = 1e-12 * ff
        bound = (1.0 + margin) * float(self.monitoring_signal(winner.b, winner.k)) + rounding
        b, axis = self.grid.b.values, self.grid.k
        half = b * vx - fx
        rest = ff + b * (b * vv - 2.0 * fv) - bound
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(half**2 - xx * rest)
            low = (-half - root) / xx
            high = (-half + root) / xx
        if xx == 0.0:
            low = np.where(rest <= 0.0, -np.inf, np.nan)
            high = -low
        low = np.where(np.isnan(low), np.inf, (low - axis.first) / axis.spacing)
        high = np.where(np.isnan(high), -np.inf, (high - axis.first) / axis.spacing)
        first = np.ceil(np.clip(low - 1e-9, 0, axis.count)).astype(np.int64)
        last = np.floor(np.clip(high + 1e-9, -1, axis.count - 1)).astype(np.int64)
        row = round((winner.b - self.grid.b.first) / self.grid.b.spacing)
        column = round((winner.k - axis.first) / axis.spacing)
        first[row], last[row] = min(first[row], column), max(last[row], column)
        return first, last

    @property
    def at_edge(self) -> tuple[str, ...]:
        """Parameters, of "b" and "k", whose winning value is the grid's first or last."""
        edges = self.edges()
        return tuple(name for name in edges if getattr(self.estimate, name) in edges[name])

    def edges(self) -> dict[str, tuple[float, float]]:
        """First and last value of "b" and of "k", as the winner takes them."""
        _, b_first, b_step, b_last, _, k_first, k_step, k_last, _ = self.parameters
        return {
            "b": (b_first, b_first + b_last * b_step),
            "k": (k_first, k_first + k_last * k_step),
        }

    def note(self, estimates: Estimates) -> str | None:
        """Whether the winner lay on the grid's edge in one sample of ten, or does now."""
        shares = {
            name: float(np.mean(np.isin(getattr(estimates, name), edges)))
            for name, edges in self.edges().items()
            if len(estimates.b)
        }
        told = [
            f"in {name} in {share:.0%} of the samples"
            for name, share in shares.items()
            if share >= 0.1 or name in self.at_edge
        ]
        return f"the winner lies on the grid's edge {' and '.join(told)}" if told else None
