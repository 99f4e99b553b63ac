"""Ordinary least squares (OLS) over a sliding window, as a reference for the other methods."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from math import inf, sqrt
from typing import Self

from estimation.checks import LARGEST, check_correlation
from estimation.estimator import Estimator
from estimation.method_settings import MethodSettings
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, State, Vector, below, diagonal, zeros

SINGULAR = 1e-10
"""Smallest ratio of two sums of squares for which the window determines all parameters.

The ratio is computed for each regressor. Its numerator is the sum of squares of the part of the
regressor that is orthogonal to the regressors before it, for example the part of x that is
orthogonal to v. Its denominator is the largest recent sum of squares of the regressor.
"""
SMALLEST_SQUARES = 1e-60
"""A regressor with a smaller sum of squares is treated as zero."""
LONGEST = 1_000_000
"""Largest number of samples in a window."""
WINDOW = 2.0
"""Length of the window of the method `window`, in units of the memory.

With exponential forgetting, the weights w of the samples decay with a memory of N samples. A mean
with such weights has the same noise as a mean of (sum w)^2 / sum w^2 = 2 N samples of equal weight.
So the window has 2 N samples.
"""


@dataclass(frozen=True, slots=True)
class WindowParameters:
    """Constant settings of the estimator `BatchWindow`, which `step` reads."""

    samples: int
    """Number of samples in a full window."""
    correlation: float
    """Correlation length of the force noise, in samples, >= 1."""
    window: float
    """Length of the window [s]. A longer gap in the data removes all samples from the window."""


@dataclass(slots=True)
class WindowState(State):
    """Variables of the estimator `BatchWindow`, which `step` updates at each sample.

    A sample is a vector z = (phi, f) with the m regressors phi and the force f.
    """

    place: int
    """Index of the oldest sample in `ring`."""
    count: int
    """Number of samples in the window."""
    sums: Matrix
    """Sums of z z' over the window, lower triangle, (m + 1, m + 1)."""
    fresh: Matrix
    """Sums of z z' since `place` was last 0, lower triangle, (m + 1, m + 1)."""
    peak: Vector
    """Largest sum of squares of each regressor since `place` was last 0, (m,)."""
    L: Matrix
    """Factors of `sums` = L D L', (m + 1, m + 1). L is below the diagonal, D on the diagonal, and
    D L' above the diagonal."""
    column: Vector
    """Array in which `unit_variance` stores intermediate results, (m + 1,)."""
    z: Vector
    """The present sample, (m + 1,)."""
    ring: Matrix
    """Ring buffer of the samples in the window, (capacity, m + 1)."""


def slide(
    parameters: WindowParameters, state: WindowState, phi: Regressors, f: float, dt: float
) -> None:
    """Add the sample z = (phi, f) to the window, and update the sums of z z' over the window.

    In a full window, the new sample replaces the oldest sample. After a gap in the data that is
    longer than the window, the new sample is the only one.

    In `sums`, new samples are added and old samples are subtracted, so rounding errors accumulate.
    In `fresh`, new samples are only added. `place` is the index of the oldest sample in the ring
    buffer. Each time `place` returns to 0, `fresh` contains all samples of the window and replaces
    `sums`.
    """
    sums, fresh, peak, z = state.sums, state.fresh, state.peak, state.z
    m = len(phi)
    if dt > parameters.window:
        empty(state)
    for i in below[m]:
        z[i] = phi[i]
    z[m] = f
    kept = 1.0 if state.count >= parameters.samples else 0.0
    oldest = state.ring[state.place]
    entries = below[m + 1]
    for i in entries:
        new = z[i]
        old = kept * oldest[i]
        row, fresh_row = sums[i], fresh[i]
        for j in below[i + 1]:
            product = new * z[j]
            row[j] += product - old * oldest[j]
            fresh_row[j] += product
    for i in entries:
        oldest[i] = z[i]
    for i in below[m]:
        square = sums[i][i]
        if square > peak[i]:
            peak[i] = square
    if state.count < parameters.samples:
        state.count += 1
    state.place += 1
    if state.place >= parameters.samples:
        state.place = 0
        renew(state)


def empty(state: WindowState) -> None:
    """Remove all samples from the window, and set its sums to zero."""
    state.place = 0
    state.count = 0
    for i in below[len(state.peak)]:
        state.peak[i] = 0.0
    for i in below[len(state.sums)]:
        for j in below[len(state.sums)]:
            state.sums[i][j] = 0.0
            state.fresh[i][j] = 0.0


def renew(state: WindowState) -> None:
    """Replace `sums` by `fresh`, which has smaller rounding errors, and set `fresh` to zero.

    Both are the sums of z z' over the samples z in the window, see `slide`.
    """
    sums, fresh = state.sums, state.fresh
    for i in below[len(sums)]:
        for j in below[i + 1]:
            sums[i][j] = fresh[i][j]
            fresh[i][j] = 0.0
    for i in below[len(state.peak)]:
        state.peak[i] = sums[i][i]


def factorise(state: WindowState) -> bool:
    """Factorise the matrix `sums` into L D L', with L unit lower triangular and D diagonal.

    `sums` is the sum of z z' over the window, where z = (phi, f) is a sample. L and D are stored in
    the field `L` of the state. The last element of D is the sum of squared residuals.

    The result is False if the samples in the window do not determine all parameters.
    """
    sums, L, peak = state.sums, state.L, state.peak
    m = len(peak)
    for i in below[m + 1]:
        row, sums_row = L[i], sums[i]
        total = sums_row[i]
        for j in below[i]:
            upper = L[j]
            value = sums_row[j]
            for n in below[j]:
                value -= row[n] * L[n][j]
            part = value / upper[j]
            upper[i] = value
            row[j] = part
            total -= part * value
        row[i] = total
        if i < m and not total > SINGULAR * peak[i] + SMALLEST_SQUARES:
            return False
    return True


def solve(parameters: WindowParameters, state: WindowState) -> None:
    """Compute theta and its standard deviations from the factors L and D of `factorise`.

    Let L_1 be L without its last row and column, and let l be the last row of L without its last
    element. theta is the solution of L_1' theta = l.

    The noise variance is the sum of squared residuals divided by n - m, the degrees of freedom of n
    samples and m parameters. It is multiplied by the setting `correlation`.
    """
    theta, L = state.theta, state.L
    m = len(theta)
    freedom = state.count - m
    noise = parameters.correlation * max(L[m][m], 0.0) / freedom
    for back in below[m]:
        i = m - 1 - back
        total = L[m][i]
        for later in below[back]:
            j = i + 1 + later
            total -= L[j][i] * theta[j]
        theta[i] = total
    for i in below[m]:
        state.std[i] = sqrt(noise * unit_variance(state, i))


def unit_variance(state: WindowState, i: int) -> float:
    """Return the variance of parameter i for a noise variance of 1 N^2.

    It is the diagonal element i of the inverse of the sum of phi phi' over the window. This sum is
    available as the factors L and D of `factorise`.
    """
    L, column = state.L, state.column
    m = len(state.theta)
    column[i] = 1.0
    total = 1.0 / L[i][i]
    for later in below[m - 1 - i]:
        j = i + 1 + later
        value = 0.0
        for n in below[later + 1]:
            value -= L[j][i + n] * column[i + n]
        column[j] = value
        total += value * value / L[j][j]
    return total


def step(
    parameters: WindowParameters, state: WindowState, phi: Regressors, f: float, dt: float
) -> None:
    """Add the sample to the window, and compute theta by least squares over the window.

    If the window does not determine all parameters, theta does not change.
    """
    slide(parameters, state, phi, f, dt)
    if state.count > len(phi) and factorise(state):
        solve(parameters, state)
    else:
        state.held = True


class BatchWindow(Estimator):
    """Ordinary least squares over the samples in a sliding window, with equal weights.

    The model is f = phi' theta, and the estimate is

        theta = (sum phi phi')^-1 sum phi f.

    The covariance is the usual covariance s (sum phi phi')^-1, multiplied by `correlation`. The
    noise variance s is the sum of squared residuals divided by n - m, the degrees of freedom of n
    samples and m parameters (N. R. Draper, H. Smith, "Applied Regression Analysis", 1998).

    The estimate changes only if the samples in the window determine all parameters. Before the
    first change, theta is 0 and the standard deviations are `LARGEST` (1e30). If a gap in the data
    is longer than the window, all samples before the gap are removed from the window.

    Parameters
    ----------
    window
        Length of the window [s].
    sample_period
        Time between samples [s]. The number of samples in the window is window / sample_period,
        rounded to an integer.
    model
        Model f = phi' theta that defines the regressors phi.
    correlation
        Correlation length of the force noise, in samples; 1 for white noise.

    Raises
    ------
    ValueError
        The window has too few samples (not more than the number of parameters) or too many (more
        than `LONGEST`, 1e6), or another argument is out of its range.
    """

    step = staticmethod(step)
    used_settings = ("forgetting",)

    def __init__(
        self,
        window: float,
        sample_period: float,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        m = model.regressors
        if not (0.0 < sample_period < inf and 0.0 < window < inf):
            raise ValueError(
                f"window and sample period must be positive, got {window} and {sample_period}"
            )
        check_correlation(correlation)
        if not m < round(min(window / sample_period, 2.0 * LONGEST)) <= LONGEST:
            raise ValueError(
                f"a window must have more than {m} samples and at most {LONGEST}, got "
                f"{window} s of {sample_period} s each"
            )
        self.samples = round(window / sample_period)
        capacity = 1 << (self.samples - 1).bit_length()  # powers of two need fewer compilations
        square = diagonal(zeros(m + 1))
        super().__init__(
            WindowParameters(self.samples, correlation, window),
            WindowState(
                zeros(m),
                [LARGEST] * m,
                False,
                place=0,
                count=0,
                sums=square,
                fresh=deepcopy(square),
                peak=zeros(m),
                L=deepcopy(square),
                column=zeros(m + 1),
                z=zeros(m + 1),
                ring=[zeros(m + 1) for _ in range(capacity)],
            ),
            model,
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            WINDOW * settings.memory, settings.sample_period, settings.model, settings.correlation
        )
