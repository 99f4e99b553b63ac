"""Compute the 95 % intervals of k and b that the motion and the noise of the force permit.

By the Cramer-Rao bound, no unbiased estimator of k and b has a smaller variance than that which
follows from the information matrix of the motion and from the noise of the force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.arrays import Floats
from estimation.checks import check_positive, checked_samples, is_valid, sample_error
from estimation.compiled import Law, sweep
from estimation.conditioning import BANDWIDTH
from estimation.estimator import LEVEL_95
from estimation.step import B, K, Matrix, Regressors, State, Vector, below, zeros

BLOCK = 0.4
"""Length of a block, divided by the period of the bandwidth of the filters: 20 ms for 20 Hz. So
successive blocks are little correlated, and a block is short compared with the motion."""
FEWEST_BLOCKS = 20
"""Fewest blocks from which intervals are computed; there are up to 6 regressors."""
LARGEST_EXPECTED = 1.0
"""If the expected half width is larger than this fraction of the value, the interval contains zero,
and the program reports that the motion does not determine the value."""
SCALE = 1e-3
"""Unit of the displacement in the powers of the regressors [m], so that their sums do not overflow.
"""
LEAST_PIVOT = 1e-9
"""Least part of the square of a regressor that the previous regressors do not explain. A regressor
below this limit is left out."""
LARGEST_CORRELATION = 0.99
"""Largest correlation of the noise of successive blocks that is assumed."""
MEMORY = 0.02
"""Share of a block in the running mean of the correlation of the noise."""
SIZE = 6
"""Number of regressors: 1, x, v, x^2, x^3, x^4."""
X, V = 1, 2
"""Places of x and v among the regressors."""


class ExpectedHalfWidths(NamedTuple):
    """Expected half widths of the 95 % intervals of k and b, as fractions of k and b.

    NaN before they are known.
    """

    k: float
    b: float


@dataclass(frozen=True, slots=True)
class InformationParameters:
    """Constant settings of `step`."""

    block: float
    """Length of a block [s]."""
    omega: float
    """Natural frequency of the filter of position and force [rad/s]."""


@dataclass(slots=True)
class InformationState(State):
    """Variables that `step` updates. `theta` is b and k, and `std` their expected deviations."""

    origin: float
    """Displacement of the first sample, from which the powers are computed [m]; NaN before."""
    span: float
    """Length of the present block so far [s]."""
    sums: Vector
    """Integrals of the regressors and of the force over the present block."""
    count: float
    """Number of blocks."""
    S: Matrix
    """Sum over the blocks of the products of the mean regressors and force, lower triangle."""
    L: Matrix
    """Unit lower triangular factor of S = L D L'."""
    D: Vector
    """Diagonal of D, 0 for a regressor that is left out. The last value is the sum of the squares
    of the force residual."""
    coefficients: Vector
    """Least-squares coefficients of the regressors."""
    noise: float
    """Variance of the noise of independent blocks [N^2]."""
    weights: Vector
    """Weights of the coefficients in b or k."""
    part: Vector
    """Result of the forward substitution of `weights`."""
    before: float
    """Residual of the previous block for the coefficients before that block [N]."""
    square: float
    """Running mean of the squares of these residuals [N^2]."""
    product: float
    """Running mean of the products of successive residuals [N^2]."""


def step(
    parameters: InformationParameters, state: InformationState, phi: Regressors, f: float, dt: float
) -> None:
    """Add one sample to the present block, and compute the expected intervals after each block.

    The force of a stiffness that depends on depth passes the low-pass filter H after the powers of
    x, and x before them. To the second order in the frequency, H x^n = y^n + n (n - 1) y^(n-2)
    (y'/omega)^2 with y = H x. Without this correction, the difference would be taken as noise.
    """
    if math.isnan(state.origin):
        state.origin = phi[K]
    sums = state.sums
    z, speed = (phi[K] - state.origin) / SCALE, phi[B] / (SCALE * parameters.omega)
    square, curved = z * z, speed * speed
    sums[0] += dt
    sums[X] += z * dt
    sums[V] += phi[B] * dt
    sums[3] += (square + 2.0 * curved) * dt
    sums[4] += z * (square + 6.0 * curved) * dt
    sums[5] += square * (square + 12.0 * curved) * dt
    sums[SIZE] += f * dt
    state.span += dt
    if state.span < parameters.block:
        return
    for i in below[SIZE + 1]:
        sums[i] /= state.span
    state.span = 0.0
    _compare(state, sums)
    S = state.S
    for i in below[SIZE + 1]:
        for j in below[i + 1]:
            S[i][j] += sums[i] * sums[j]
    state.count += 1.0
    for i in below[SIZE + 1]:
        sums[i] = 0.0
    if state.count >= FEWEST_BLOCKS:
        _solve(state)


def _compare(state: InformationState, means: Vector) -> None:
    """Compare the mean force of a block with its prediction, for the correlation of the noise."""
    if state.count < FEWEST_BLOCKS:
        return
    residual = means[SIZE]
    for i in below[SIZE]:
        residual -= state.coefficients[i] * means[i]
    state.square += MEMORY * (residual * residual - state.square)
    state.product += MEMORY * (residual * state.before - state.product)
    state.before = residual


def _solve(state: InformationState) -> None:
    """Compute estimates and expected standard deviations from the sums over the blocks."""
    S, L, D, coefficients = state.S, state.L, state.D, state.coefficients
    used = 0.0
    for i in below[SIZE + 1]:
        pivot = S[i][i]
        for j in below[i]:
            value = S[i][j]
            for n in below[j]:
                value -= L[i][n] * D[n] * L[j][n]
            L[i][j] = value / D[j] if D[j] > 0.0 else 0.0
            pivot -= L[i][j] * L[i][j] * D[j]
        if i == SIZE:
            D[i] = max(pivot, 0.0)
        elif pivot > LEAST_PIVOT * S[i][i]:
            D[i] = pivot
            used += 1.0
        else:
            D[i] = 0.0
    for n in below[SIZE]:
        i = SIZE - 1 - n
        value = L[SIZE][i]
        for m in below[n]:
            j = SIZE - 1 - m
            value -= L[j][i] * coefficients[j]
        coefficients[i] = value if D[i] > 0.0 else 0.0
    correlation = state.product / state.square if state.square > 0.0 else 0.0
    correlation = min(max(correlation, 0.0), LARGEST_CORRELATION)
    noise = D[SIZE] / (state.count - used) * (1.0 + correlation) / (1.0 - correlation)
    state.noise = noise
    weights, z = state.weights, S[X][0] / state.count
    for i in below[SIZE]:
        weights[i] = 1.0 if i == V else 0.0
    state.theta[B] = coefficients[V]
    state.std[B] = math.sqrt(noise * _variance(state)) if D[V] > 0.0 else math.inf
    weights[X], weights[V] = 1.0, 0.0
    weights[3], weights[4], weights[5] = 2.0 * z, 3.0 * z * z, 4.0 * z * z * z
    slope = 0.0
    for i in below[SIZE]:
        slope += weights[i] * coefficients[i]
    state.theta[K] = slope / SCALE
    state.std[K] = math.sqrt(noise * _variance(state)) / SCALE if D[X] > 0.0 else math.inf


def _variance(state: InformationState) -> float:
    """Return the variance of the weighted sum of the coefficients, for a noise of variance 1."""
    L, D, part = state.L, state.D, state.part
    variance = 0.0
    for i in below[SIZE]:
        value = state.weights[i]
        for j in below[i]:
            value -= L[i][j] * part[j]
        part[i] = value
        if D[i] > 0.0:
            variance += value * value / D[i]
    return variance


class ExpectedIntervals:
    """The 95 % intervals of k and b that motion and noise permit, from all samples so far.

    The force is f = b v + a polynomial of degree 4 in x, so that stiffness may depend on depth. The
    slope at the mean displacement is k. The covariance of the coefficients is the inverse of the
    information matrix: s (sum phi phi')^-1, with the regressors phi averaged over short blocks. The
    variance s of the noise is that of the residual of least squares. It is increased by
    (1 + r) / (1 - r) for the correlation r of successive residuals. So an error of the model also
    widens the intervals.

    These are the intervals of an estimator without bias. They contain no error of lag and lost
    motion between encoder and tip.

    Parameters
    ----------
    bandwidth
        Bandwidth of the low-pass filter of position and force [Hz].

    Raises
    ------
    ValueError
        The bandwidth is not positive.

    References
    ----------
    L. Ljung, "System Identification: Theory for the User", 2nd ed., Prentice Hall, 1999, section
    7.4 (Cramer-Rao inequality) and 13 (experiment design).
    """

    def __init__(self, bandwidth: float = BANDWIDTH) -> None:
        check_positive(bandwidth=bandwidth)
        self._law = Law(step, InformationParameters(BLOCK / bandwidth, 2.0 * math.pi * bandwidth))
        nan, size = math.nan, SIZE + 1
        self._state = InformationState(
            [nan, nan],
            [nan, nan],
            True,
            nan,
            0.0,
            zeros(size),
            0.0,
            [zeros(size) for _ in range(size)],
            [zeros(size) for _ in range(size)],
            zeros(size),
            zeros(SIZE),
            0.0,
            zeros(SIZE),
            zeros(SIZE),
            0.0,
            0.0,
            0.0,
        )

    def update(
        self, x: float, v: float, f: float, dt: float, is_open: bool = True
    ) -> ExpectedHalfWidths:
        """Process one sample, and return the expected half widths.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s] and force [N].
        dt
            Time since the previous sample [s].
        is_open
            Whether there is contact and motion. Otherwise the sample is not used.

        Raises
        ------
        ValueError
            A value is not finite or too large, or `dt` is not positive.
        """
        if not is_valid(dt, abs(x) + abs(v) + abs(f)):
            raise sample_error(dt, x=x, v=v, f=f)
        state = self._state
        if is_open:
            step(self._law.parameters, state, (v, x), f, dt)
        (b, k), (b_std, k_std) = state.theta, state.std
        return ExpectedHalfWidths(relative(k, k_std), relative(b, b_std))

    @property
    def known(self) -> tuple[float, float, float, float, float] | None:
        """Values for the design of an excitation; None before they are known.

        They are k [N/m], b [N s/m], the inverse of the variances of both, and the spectral density
        of the noise of the force [N^2 s].
        """
        state = self._state
        if not (state.std[B] < math.inf and state.std[K] < math.inf and state.noise > 0.0):
            return None
        density = state.noise * self._law.parameters.block
        (b, k), (b_std, k_std) = state.theta, state.std
        return k, b, k_std**-2, b_std**-2, density

    def run(
        self,
        x: ArrayLike,
        v: ArrayLike,
        f: ArrayLike,
        dt: ArrayLike,
        is_open: NDArray[np.bool_] | None = None,
    ) -> tuple[Floats, Floats]:
        """Process n samples, with the same results as n calls of `update`.

        Parameters
        ----------
        x, v, f, dt
            Displacement [m], velocity [m/s], force [N] and time since the previous sample [s], each
            of shape (n,).
        is_open
            Whether there is contact and motion at each sample, shape (n,). Default: at all samples.

        Returns
        -------
        Expected half widths of k and of b after each sample, as fractions of k and b, each of shape
        (n,).

        Raises
        ------
        ValueError
            The shapes differ, a value is not finite or too large, or a `dt` is not positive.
        """
        samples = checked_samples(x, v, f, dt)
        if is_open is not None:
            samples = samples._replace(open=is_open)
        b, k, b_std, k_std, _ = sweep(self._law, self._state, samples).T
        with np.errstate(divide="ignore", invalid="ignore"):
            return LEVEL_95 * k_std / np.abs(k), LEVEL_95 * b_std / np.abs(b)


def half_width_text(half: float) -> str:
    """Return the half width of an interval, a fraction of the value, as text in percent."""
    if math.isnan(half):
        return "not known"
    if half > 10.0:
        return "± >1000 %"
    return f"± {100.0 * half:.{0 if half >= 0.0995 else 1 if half >= 0.00995 else 2}f} %"


def relative(value: float, std: float) -> float:
    """Return the half width of a 95 % interval as a fraction of the value."""
    if value == 0.0:
        return math.inf
    return LEVEL_95 * std / abs(value)
