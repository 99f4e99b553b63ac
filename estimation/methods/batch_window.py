"""Ordinary least squares over a sliding window, the yardstick of the others (OLS)."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from math import inf, sqrt

from estimation.checks import LARGEST, check_correlation
from estimation.estimator import Estimator
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Matrix, Regressors, State, Vector, below, diagonal, zeros

SINGULAR = 1e-10
"""A regressor of which a smaller share is its own, not the others', says nothing."""
NOTHING = 1e-60
"""So small a sum of squares of a regressor says nothing."""
LONGEST = 1_000_000
"""Most samples in a window."""


@dataclass(frozen=True, slots=True)
class WindowParameters:
    """Parameters of `step`."""

    samples: int
    """How many samples the window has."""
    correlation: float
    """Samples for each independent one, >= 1."""
    window: float
    """Length of the window [s]; a gap as long empties it."""


@dataclass(slots=True)
class WindowState(State):
    """State of `step`, of z = (phi, f) with m + 1 entries."""

    place: int
    """Row of the oldest sample in the ring."""
    count: int
    """How many samples there are in the window."""
    sums: Matrix
    """Sums of z z' over the window, lower half, (m + 1, m + 1)."""
    fresh: Matrix
    """The same since the ring was last at its start, (m + 1, m + 1)."""
    peak: Vector
    """Largest sum of squares of each regressor since then, (m,)."""
    L: Matrix
    """Factor of sums = L D L': L below the diagonal, D on it, D L' above; (m + 1, m + 1)."""
    column: Vector
    """A vector for `solve`, (m + 1,)."""
    z: Vector
    """The sample, (m + 1,)."""
    ring: Matrix
    """The samples of the window, (capacity, m + 1)."""


def slide(
    parameters: WindowParameters, state: WindowState, phi: Regressors, f: float, dt: float
) -> None:
    """Put z = (phi, f) in place of the oldest sample; the sums of z z' over the window with it.

    A second set of sums has only been added to since the ring was last at its start. There it
    takes the place of the first, so that rounding does not accumulate.
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
    """Forget the samples in the window."""
    state.place = 0
    state.count = 0
    for i in below[len(state.peak)]:
        state.peak[i] = 0.0
    for i in below[len(state.sums)]:
        for j in below[len(state.sums)]:
            state.sums[i][j] = 0.0
            state.fresh[i][j] = 0.0


def renew(state: WindowState) -> None:
    """Let the fresh sums take the place of the sums."""
    sums, fresh = state.sums, state.fresh
    for i in below[len(sums)]:
        for j in below[i + 1]:
            sums[i][j] = fresh[i][j]
            fresh[i][j] = 0.0
    for i in below[len(state.peak)]:
        state.peak[i] = sums[i][i]


def factorise(state: WindowState) -> bool:
    """Sums of z z' = L D L'; whether that has one solution for theta.

    The last row of L holds what the parameters follow from, the last of D the squared residual.
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
        if i < m and not total > SINGULAR * peak[i] + NOTHING:
            return False
    return True


def solve(parameters: WindowParameters, state: WindowState) -> None:
    """Theta = L'^-1 of the last row of L, and its standard deviations.

    The noise variance is the squared residual by n - m degrees of freedom.
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
    """Variance of a parameter for a noise variance of 1: e' (L D L')^-1 e, e the unit vector."""
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
    """Least squares over the window; the estimate is held where that has no one solution."""
    slide(parameters, state, phi, f, dt)
    if state.count > len(phi) and factorise(state):
        solve(parameters, state)
    else:
        state.held = True


class BatchWindow(Estimator):
    """Ordinary least squares over the latest samples, all of one weight.

        theta = (sum phi phi')^-1 sum phi f

    The textbook's interval: the covariance is s (sum phi phi')^-1, with s the squared residual
    by n - m degrees of freedom (N. R. Draper, H. Smith, "Applied Regression Analysis", 1998),
    times `correlation`.

    The estimate is held while the window does not tell the parameters apart. Until it first
    does, the standard deviations are `LARGEST`. A gap as long as the window empties it.

    Parameters
    ----------
    window
        Length of the window [s].
    sample_period
        Time between samples [s]; the window has window / sample_period of them, rounded.
    model
        The regressors.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        The window has no more samples than the model parameters, or a million, or a
        parameter is out of its range.
    """

    step = staticmethod(step)

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
        capacity = 1 << (self.samples - 1).bit_length()  # few sizes, few compilations
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
