"""The multi-estimator (ME): the candidate (b, k) of least monitoring signal, out of a grid."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimation.checks import check_correlation
from estimation.compiled import Floats, Parameters, Regressors, State
from estimation.estimator import Estimates, Estimator
from estimation.linear_gain import NOISE_MEMORY
from estimation.methods.grid import Grid
from estimation.methods.lattice import inside, least_in_box, lowest_on_border
from estimation.unrolled import Helpers

Indices = NDArray[np.int64]

TIE = 1e-9
"""Weight of the tie-breaking term, as a share of the monitoring signal that the grid spans."""
FASTEST = 1e6
"""Largest forgetting rate [1/s]."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Let the sums decay, add the sample, and take the candidate of least (11)."""
    b_step, b_last, k_step, k_last = parameters[2], parameters[3], parameters[6], parameters[7]
    decay_and_add(parameters[0], state, phi[0], phi[1], f, dt)
    state[0], state[1] = least_candidate(
        state,
        parameters[1],
        b_step,
        b_last,
        parameters[4],
        parameters[5],
        k_step,
        k_last,
        parameters[8],
        TIE,
    )
    state[2], state[3] = deviations(parameters[9], state, b_step * b_last, k_step * k_last, dt)


def decay_and_add(
    twice_lambda: float, state: State, v: float, x: float, f: float, dt: float
) -> None:
    """The sums from state[5] on: ff, fv, fx, vv, vx, xx, those of squared weights, the weights'.

    With the force error held over `dt`, (11) is exactly mu <- e^(-2 lambda dt) mu + w e^2
    with w = (1 - e^(-2 lambda dt)) / 2 lambda. Its e^2 = (b v + k x - f)^2 opens into
    products of (f, v, x), whose sums so decayed give mu of every candidate at once.
    """
    loss = -math.expm1(-twice_lambda * dt)
    decay = 1.0 - loss
    weight = loss / twice_lambda if twice_lambda > 0.0 else dt
    vv, vx, xx = weight * v * v, weight * v * x, weight * x * x
    state[5] = state[5] * decay + weight * f * f
    state[6] = state[6] * decay + weight * f * v
    state[7] = state[7] * decay + weight * f * x
    state[8] = state[8] * decay + vv
    state[9] = state[9] * decay + vx
    state[10] = state[10] * decay + xx
    decay_twice = decay * decay
    state[11] = state[11] * decay_twice + weight * vv
    state[12] = state[12] * decay_twice + weight * vx
    state[13] = state[13] * decay_twice + weight * xx
    state[14] = state[14] * decay + weight


def least_candidate(
    state: State,
    b_first: float,
    b_step: float,
    b_last: float,
    b_zero: float,
    k_first: float,
    k_step: float,
    k_last: float,
    k_zero: float,
    share: float,
) -> tuple[float, float]:
    """The candidate (b, k) of least monitoring signal, out of a grid.

    Each axis is given by its first value, its spacing, and the indices of its last value and of
    the one nearest zero. The tie-breaking term is a `share` of the signal that the grid spans.
    """
    ff, fv, fx = state[5], state[6], state[7]
    vv, vx, xx = state[8], state[9], state[10]
    b_curvature = b_step * b_step * vv
    k_curvature = k_step * k_step * xx
    tie = share * (ff + b_curvature * b_last * b_last + k_curvature * k_last * k_last) + 1e-100
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
    return b_first + i * b_step, k_first + j * k_step


def deviations(
    correlation: float, state: State, b_most: float, k_most: float, dt: float
) -> tuple[float, float]:
    """Root mean square errors of the candidate (state[0], state[1]), `b_most`, `k_most` at most.

    The form's own least point is weighted least squares, R theta = r. White noise of variance s
    gives it the covariance s R^-1 Q R^-1, with Q the sum of squared weights, and mu the
    expectation s (sum of weights - tr R^-1 Q), from which s is had, as a mean over
    `NOISE_MEMORY`. To its variance comes the square of the candidate's distance from it.
    """
    vv, vx, xx = state[8], state[9], state[10]
    determinant = vv * xx - vx * vx
    if not determinant > 1e-12 * vv * xx + 1e-300:
        return b_most, k_most
    inverse = 1.0 / determinant
    bb, bk, kk = xx * inverse, -vx * inverse, vv * inverse
    q_vv, q_vx, q_xx, weights = state[11], state[12], state[13], state[14]
    b_v, b_x = bb * q_vv + bk * q_vx, bb * q_vx + bk * q_xx
    k_v, k_x = bk * q_vv + kk * q_vx, bk * q_vx + kk * q_xx
    freedom = weights - b_v - k_x
    if not freedom > 1e-6 * weights:
        return b_most, k_most
    fv, fx = state[6], state[7]
    b, k = bb * fv + bk * fx, bk * fv + kk * fx
    residual = state[5] - b * fv - k * fx
    share = dt / (NOISE_MEMORY + dt)
    state[15] += share * (1.0 - state[15])
    share /= state[15] * freedom
    state[16] += share * ((residual if residual > 0.0 else 0.0) - freedom * state[16])
    noise = correlation * state[16]
    b -= state[0]
    k -= state[1]
    b_square = noise * (b_v * bb + b_x * bk) + b * b
    k_square = noise * (k_v * bk + k_x * kk) + k * k
    b_std = math.sqrt(b_square) if b_square > 0.0 else 0.0
    k_std = math.sqrt(k_square) if k_square > 0.0 else 0.0
    return b_std if b_std < b_most else b_most, k_std if k_std < k_most else k_most


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
    correlation
        Samples for each independent one, see `LinearGainEstimator`.
    further_parameters, further_state
        What the step of a subclass needs besides, at the end of its parameters and state.

    Raises
    ------
    ValueError
        The forgetting rate or the correlation is out of its range.
    """

    step = staticmethod(step)
    helpers: ClassVar[Helpers] = (
        decay_and_add,
        inside,
        lowest_on_border,
        least_in_box,
        least_candidate,
        deviations,
    )
    gated = False

    def __init__(
        self,
        grid: Grid,
        forgetting_rate: float,
        correlation: float = 1.0,
        *,
        further_parameters: tuple[float, ...] = (),
        further_state: tuple[float, ...] = (),
    ) -> None:
        if not 0.0 <= forgetting_rate <= FASTEST:
            raise ValueError(
                f"forgetting rate must be between 0 and {FASTEST:g}/s, got {forgetting_rate}"
            )
        check_correlation(correlation)
        self.grid = grid
        parameters = [2.0 * forgetting_rate]
        for axis in (grid.b, grid.k):
            parameters += [axis.first, axis.spacing, axis.count - 1, axis.nearest_zero]
        axes = (grid.b, grid.k)
        zero = (axis.first + axis.nearest_zero * axis.spacing for axis in axes)
        spans = (axis.spacing * (axis.count - 1) for axis in axes)
        super().__init__(
            (*parameters, correlation, *further_parameters),
            (*zero, *spans, 0.0, *(0.0,) * 12, *further_state),
        )

    def monitoring_signal(self, b: Floats | float, k: Floats | float) -> Floats:
        """(11) of the candidates (b, k) [N^2 s], arrays that broadcast."""
        ff, fv, fx, vv, vx, xx = self.state[5:11]
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
        ff, fv, fx, vv, vx, xx = self.state[5:11]
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
        _, b_first, b_step, b_last, _, k_first, k_step, k_last, *_ = self.parameters
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
