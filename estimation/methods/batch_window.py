"""Ordinary least squares over a sliding window, the yardstick of the others (OLS)."""

from __future__ import annotations

from math import inf, sqrt

from estimation.checks import LARGEST, check_correlation
from estimation.compiled import Parameters, Regressors, State
from estimation.estimator import Estimator
from estimation.model import KELVIN_VOIGT, Model

SINGULAR = 1e-10
"""A regressor of which a smaller share is its own, not the others', says nothing."""
NOTHING = 1e-60
"""So small a sum of squares of a regressor says nothing."""
LONGEST = 1_000_000
"""Most samples in a window."""


def slide(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Put z = [phi, f] in place of the oldest sample; the sums of z z' over the window with it.

    A second set of sums has only been added to since the ring was last at its start. There it
    takes the place of the first, so that rounding does not pile up.
    """
    m = len(phi)
    width = m + 1
    place = 2 * m + 1
    count = place + 1
    peak = count + 1
    sums = peak + m
    fresh = sums + width * width
    z = fresh + 2 * width * width
    ring = z + width
    if dt > parameters[2]:
        state[place] = 0.0
        state[count] = 0.0
        for i in range(m):
            state[peak + i] = 0.0
        for i in range(2 * width * width):
            state[sums + i] = 0.0
    for i in range(m):
        state[z + i] = phi[i]
    state[z + m] = f
    kept = 1.0 if state[count] >= parameters[0] else 0.0
    at = ring + width * int(state[place])
    for i in range(width):
        new = state[z + i]
        old = kept * state[at + i]
        for j in range(i + 1):
            product = new * state[z + j]
            state[sums + i * width + j] += product - old * state[at + j]
            state[fresh + i * width + j] += product
    for i in range(m):
        state[peak + i] = max(state[peak + i], state[sums + i * width + i])
    for i in range(width):
        state[at + i] = state[z + i]
    state[count] = min(state[count] + 1.0, parameters[0])
    state[place] += 1.0
    if state[place] >= parameters[0]:
        state[place] = 0.0
        for i in range(width):
            for j in range(i + 1):
                state[sums + i * width + j] = state[fresh + i * width + j]
                state[fresh + i * width + j] = 0.0
        for i in range(m):
            state[peak + i] = state[sums + i * width + i]


def factorise(state: State, phi: Regressors) -> bool:
    """Sums of z z' = L D L', with L below D and D L' above; whether that tells theta.

    The last row of L holds what the parameters follow from, the last of D the squared residual.
    """
    m = len(phi)
    width = m + 1
    peak = 2 * m + 3
    sums = peak + m
    factor = sums + 2 * width * width
    regular = True
    for j in range(width):
        for i in range(j, width):
            total = state[sums + i * width + j]
            for n in range(j):
                total -= state[factor + i * width + n] * state[factor + n * width + j]
            state[factor + i * width + j] = total
        if j < m:
            pivot = state[factor + j * width + j]
            regular = regular and pivot > SINGULAR * state[peak + j] + NOTHING
            if regular:
                for i in range(j + 1, width):
                    state[factor + j * width + i] = state[factor + i * width + j]
                    state[factor + i * width + j] /= pivot
    return regular


def solve(parameters: Parameters, state: State, phi: Regressors) -> None:
    """Take theta = L'^-1 of the last row of L, and its standard deviations.

    The noise variance is the squared residual by n - m degrees of freedom.
    """
    m = len(phi)
    width = m + 1
    count = 2 * m + 2
    factor = count + 1 + m + 2 * width * width
    z = factor + width * width
    freedom = state[count] - m
    noise = parameters[1] * max(state[factor + m * width + m], 0.0) / freedom
    for later in range(m):
        row = m - 1 - later
        total = state[factor + m * width + row]
        for j in range(row + 1, m):
            total -= state[factor + j * width + row] * state[j]
        state[row] = total
    for i in range(m):
        # z from i on is row i of L^-T
        state[z + i] = 1.0
        variance = 1.0 / state[factor + i * width + i]
        for j in range(i + 1, m):
            total = 0.0
            for n in range(i, j):
                total -= state[factor + j * width + n] * state[z + n]
            state[z + j] = total
            variance += total * total / state[factor + j * width + j]
        state[m + i] = sqrt(noise * variance)


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Least squares over the window, or the estimate held where that has no one answer."""
    m = len(phi)
    slide(parameters, state, phi, f, dt)
    state[2 * m] = 1.0
    if state[2 * m + 2] > m and factorise(state, phi):
        solve(parameters, state, phi)
        state[2 * m] = 0.0


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
    helpers = (slide, factorise, solve)

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
        width = m + 1
        own = 2 + m + 3 * width * width + width + width * self.samples
        super().__init__(
            (self.samples, correlation, window),
            (*[0.0] * m, *[LARGEST] * m, 0.0, *[0.0] * own),
            model,
        )
