"""Least squares segment by segment, pooled: whether one Kelvin-Voigt body explains them all."""

from __future__ import annotations

import math

from estimation.checks import check_correlation
from estimation.compiled import Parameters, Regressors, State
from estimation.estimator import Estimates, Estimator

SIGNIFICANT = 3.090232306167813
"""Standard deviations that a normal number exceeds once in a thousand times."""
TELLING = 0.1
"""A spread between segments of this share of their root mean square is told."""
FEWEST = 8
"""Fewest samples of a segment."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Add the sample to its segment; pool the segment once it is long enough."""
    length, correlation = parameters[0], parameters[1]
    v, x = phi[0], phi[1]
    if dt > length:
        for i in range(5, 13):
            state[i] = 0.0
        dt = 0.0
    state[5] += f * f
    state[6] += f * v
    state[7] += f * x
    state[8] += v * v
    state[9] += v * x
    state[10] += x * x
    state[11] += 1.0
    state[12] += dt
    if state[12] >= length and state[11] >= FEWEST:
        ff, fv, fx = state[5], state[6], state[7]
        vv, vx, xx = state[8], state[9], state[10]
        determinant = vv * xx - vx * vx
        if determinant > 1e-9 * vv * xx:
            b = (xx * fv - vx * fx) / determinant
            k = (vv * fx - vx * fv) / determinant
            noise = max(ff - b * fv - k * fx, 1e-12 * ff) * correlation
            noise /= max(state[11] - 2.0 * correlation, 1.0)
            pool(state, 13, b, noise * xx / determinant)
            pool(state, 20, k, noise * vv / determinant)
            state[0], state[2] = pooled(state, 13)
            state[1], state[3] = pooled(state, 20)
        for i in range(5, 13):
            state[i] = 0.0
    if state[13] == 0.0:
        state[4] = 1.0


def pool(state: State, at: int, value: float, variance: float) -> None:
    """Add a segment.

    From state[at] on: count, sum of weights, weighted mean, weighted squares about it, and,
    all of one weight, mean, squares about it, and mean variance.
    """
    weight = 1.0 / (variance + 1e-300)
    state[at] += 1.0
    state[at + 1] += weight
    change = value - state[at + 2]
    state[at + 2] += weight / state[at + 1] * change
    state[at + 3] += weight * change * (value - state[at + 2])
    change = value - state[at + 4]
    state[at + 4] += change / state[at]
    state[at + 5] += change * (value - state[at + 4])
    state[at + 6] += (variance - state[at + 6]) / state[at]


def pooled(state: State, at: int) -> tuple[float, float]:
    """Mean, and its standard deviation: noise alone, or the spread where segments disagree."""
    variance = 1.0 / state[at + 1]
    if disagree(state, at):
        variance += spread(state, at)
    return state[at + 2], math.sqrt(variance)


def disagree(state: State, at: int) -> bool:
    """Whether Q exceeds the 99.9 % quantile of chi-squared, by Wilson and Hilferty."""
    freedom = state[at] - 1.0
    if freedom < 1.0:
        return False
    third = 2.0 / (9.0 * freedom)
    root = 1.0 - third + SIGNIFICANT * math.sqrt(third)
    return state[at + 3] > freedom * root * root * root


def spread(state: State, at: int) -> float:
    """Variance between the segments, by Hedges and Olkin: theirs, less what noise makes of it."""
    if state[at] < 2.0:
        return 0.0
    return max(state[at + 5] / (state[at] - 1.0) - state[at + 6], 0.0)


class PooledSegments(Estimator):
    """Batch least squares on segments of the motion, and whether they agree.

    Each segment gives b and k with their variances, and their weighted mean is the answer. If
    the environment is a Kelvin-Voigt body, the segments differ by noise alone, and Cochran's Q,
    the weighted sum of their squared deviations from the mean, follows chi-squared. Where Q
    exceeds its 99.9 % quantile, one (b, k) does not explain them all: the standard deviation
    then has the spread between segments in it, and `misfit` tells it, once it is a tenth of
    their size.

    Parameters
    ----------
    length
        Length of a segment [s], about a period of the motion: it must show b and k apart.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        The length is not positive, or the correlation is below 1.

    References
    ----------
    W. G. Cochran, "The combination of estimates from different experiments", Biometrics 10(1),
    1954; L. V. Hedges, I. Olkin, "Statistical Methods for Meta-Analysis", Academic Press, 1985
    (chapter 9, variance between studies).
    """

    step = staticmethod(step)
    helpers = (disagree, spread, pool, pooled)

    def __init__(self, length: float, correlation: float = 1.0) -> None:
        if not 0.0 < length < math.inf:
            raise ValueError(f"a segment's length must be positive, got {length} s")
        check_correlation(correlation)
        super().__init__((length, correlation), (0.0, 0.0, math.nan, math.nan, 1.0, *[0.0] * 22))

    @property
    def correlation(self) -> float:
        """Samples for each independent one; a new value counts from the next sample on.

        Raises
        ------
        ValueError
            The new value is below 1.
        """
        return self.parameters[1]

    @correlation.setter
    def correlation(self, value: float) -> None:
        check_correlation(value)
        self.parameters[1] = float(value)

    @property
    def segments(self) -> int:
        """How many segments there were so far."""
        return int(self.state[13])

    @property
    def misfit(self) -> dict[str, float]:
        """Parameters on which the segments disagree: spread between them, as a share of their size.

        Empty where one Kelvin-Voigt body explains all segments.
        """
        found = {}
        for name, at in (("b", 13), ("k", 20)):
            if disagree(self.state, at):
                between = math.sqrt(spread(self.state, at))
                share = between / math.hypot(self.state[at + 4], between)
                if share > TELLING:
                    found[name] = share
        return found

    def note(self, estimates: Estimates) -> str | None:
        """Which parameters the segments disagree on."""
        told = [f"{name} spreads by {share:.0%}" for name, share in self.misfit.items()]
        if told:
            return (
                f"Kelvin-Voigt does not fit: between {self.segments} segments "
                f"{' and '.join(told)}, beyond noise"
            )
        return None
