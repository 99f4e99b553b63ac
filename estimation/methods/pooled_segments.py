"""Fit each segment of a motion by least squares, and test whether all segments agree."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from estimation.checks import check_correlation
from estimation.estimator import Estimates, Estimator
from estimation.step import B, K, Regressors, State

SIGNIFICANT = 3.090232306167813
"""99.9 % quantile of the standard normal distribution."""
SMALLEST_REPORTED = 0.1
"""`misfit` contains a parameter if its standard deviation between segments is above this value.

The value is relative to the root mean square of the parameter over the segments.
"""
FEWEST = 8
"""Smallest number of samples in a complete segment."""


@dataclass(frozen=True, slots=True)
class SegmentParameters:
    """Constant settings of the function `step`."""

    length: float
    """Length of a segment [s]."""
    correlation: float
    """Number of samples per independent value of the force noise, >= 1."""


@dataclass(slots=True)
class Pool:
    """Statistics of one parameter over all segments that were fitted."""

    count: int
    """Number of segments."""
    weights: float
    """Sum of the weights of the segments. A weight is 1 / variance."""
    weighted_mean: float
    """Weighted mean of the parameter."""
    Q: float
    """Cochran's Q, the weighted sum of the squared deviations from the weighted mean."""
    mean: float
    """Unweighted mean of the parameter."""
    squares: float
    """Sum of the squared deviations from the unweighted mean."""
    variance: float
    """Mean of the variances that the least-squares fits of the segments give."""


@dataclass(slots=True)
class SegmentState(State):
    """Sums of products of f, v and x over the present segment, and statistics of earlier segments.

    The name of each sum is the product that is summed.
    """

    ff: float
    fv: float
    fx: float
    vv: float
    vx: float
    xx: float
    samples: int
    elapsed: float
    """Time since the segment began [s]."""
    b: Pool
    k: Pool


def step(
    parameters: SegmentParameters, state: SegmentState, phi: Regressors, f: float, dt: float
) -> None:
    """Add the sample to the present segment, and end the segment when it is long enough."""
    v, x = phi
    if dt > parameters.length:
        begin(state)
        dt = 0.0
    state.ff += f * f
    state.fv += f * v
    state.fx += f * x
    state.vv += v * v
    state.vx += v * x
    state.xx += x * x
    state.samples += 1
    state.elapsed += dt
    if state.elapsed >= parameters.length and state.samples >= FEWEST:
        end(parameters, state)
        begin(state)
    state.held = state.b.count == 0


def begin(state: SegmentState) -> None:
    """Start a new segment."""
    state.ff = state.fv = state.fx = state.vv = state.vx = state.xx = 0.0
    state.samples = 0
    state.elapsed = 0.0


def end(parameters: SegmentParameters, state: SegmentState) -> None:
    """Fit the segment by least squares, and add the estimates to the statistics of b and k.

    The segment is ignored if its motion is not sufficient to distinguish b and k.
    """
    ff, fv, fx, vv, vx, xx = state.ff, state.fv, state.fx, state.vv, state.vx, state.xx
    determinant = vv * xx - vx * vx
    if determinant > 1e-9 * vv * xx:
        b = (xx * fv - vx * fx) / determinant
        k = (vv * fx - vx * fv) / determinant
        noise = max(ff - b * fv - k * fx, 1e-12 * ff) * parameters.correlation
        noise /= max(state.samples - 2.0 * parameters.correlation, 1.0)
        add(state.b, b, noise * xx / determinant)
        add(state.k, k, noise * vv / determinant)
        state.theta[B], state.std[B] = pooled(state.b)
        state.theta[K], state.std[K] = pooled(state.k)


def add(pool: Pool, value: float, variance: float) -> None:
    """Add a segment to the statistics of one parameter: the estimated value and its variance."""
    weight = 1.0 / (variance + 1e-300)
    pool.count += 1
    pool.weights += weight
    change = value - pool.weighted_mean
    pool.weighted_mean += weight / pool.weights * change
    pool.Q += weight * change * (value - pool.weighted_mean)
    change = value - pool.mean
    pool.mean += change / pool.count
    pool.squares += change * (value - pool.mean)
    pool.variance += (variance - pool.variance) / pool.count


def pooled(pool: Pool) -> tuple[float, float]:
    """Return the weighted mean of a parameter, and the standard deviation of this mean.

    The standard deviation contains the effect of noise. If the segments disagree, the standard
    deviation also contains the variance between the segments.
    """
    variance = 1.0 / pool.weights
    if disagree(pool):
        variance += spread(pool)
    return pool.weighted_mean, math.sqrt(variance)


def disagree(pool: Pool) -> bool:
    """Return True if the segments have significantly different values of a parameter.

    The difference is significant if Cochran's Q exceeds the 99.9 % quantile of the chi-squared
    distribution. The quantile is computed by the approximation of Wilson and Hilferty.
    """
    freedom = pool.count - 1
    if freedom < 1:
        return False
    third = 2.0 / (9.0 * freedom)
    root = 1.0 - third + SIGNIFICANT * math.sqrt(third)
    return freedom * root * root * root < pool.Q


def spread(pool: Pool) -> float:
    """Return the variance of a parameter between the segments, >= 0.

    This is the variance of the estimates of the segments, minus the mean variance due to noise.
    """
    if pool.count < 2:
        return 0.0
    return max(pool.squares / (pool.count - 1) - pool.variance, 0.0)


class PooledSegments(Estimator):
    """Least squares for each segment of the motion, with a test whether the segments agree.

    A fit to each segment gives b and k with their variances. The estimate is the weighted mean of
    all segments. If the environment is a Kelvin-Voigt body, the segments differ only by noise. Then
    Cochran's Q, the weighted sum of the squared deviations from the mean, has a chi-squared
    distribution. If Q exceeds the 99.9 % quantile of this distribution, the segments do not have
    the same b or k. The standard deviation of the estimate then includes the variance between the
    segments. If the relative standard deviation between the segments is then also above 10 %, it is
    included in the property `misfit`.

    A segment is ignored if its motion is not sufficient to distinguish b and k.

    Parameters
    ----------
    length
        Length of a segment [s]. A suitable length is about one period of the motion.
    correlation
        Number of samples per independent value of the force noise, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        `length` is not positive, or `correlation` is below 1.

    References
    ----------
    W. G. Cochran, "The combination of estimates from different experiments", Biometrics 10(1),
    1954; L. V. Hedges, I. Olkin, "Statistical Methods for Meta-Analysis", Academic Press, 1985
    (chapter 9, variance between studies).
    """

    step = staticmethod(step)
    parameters: SegmentParameters
    state: SegmentState

    def __init__(self, length: float, correlation: float = 1.0) -> None:
        if not 0.0 < length < math.inf:
            raise ValueError(f"segment length must be positive, got {length} s")
        check_correlation(correlation)
        nan = math.nan
        b, k = (Pool(0, *(0.0,) * 6) for _ in range(2))
        super().__init__(
            SegmentParameters(length, correlation),
            SegmentState([0.0, 0.0], [nan, nan], True, *(0.0,) * 6, 0, 0.0, b, k),
        )

    @property
    def correlation(self) -> float:
        """Number of samples per independent value of the force noise, >= 1.

        A new value applies from the next sample on.

        Raises
        ------
        ValueError
            The new value is below 1.
        """
        return self.parameters.correlation

    @correlation.setter
    def correlation(self, value: float) -> None:
        check_correlation(value)
        self.parameters = replace(self.parameters, correlation=float(value))

    @property
    def segments(self) -> int:
        """Number of segments that were fitted."""
        return self.state.b.count

    @property
    def misfit(self) -> dict[str, float]:
        """Relative standard deviation between segments, by name of the parameter.

        A parameter is included only if the segments disagree on its value, and if the relative
        standard deviation is above `SMALLEST_REPORTED`.
        """
        found = {}
        for name, pool in (("b", self.state.b), ("k", self.state.k)):
            if disagree(pool):
                between = math.sqrt(spread(pool))
                share = between / math.hypot(pool.mean, between)
                if share > SMALLEST_REPORTED:
                    found[name] = share
        return found

    def note(self, estimates: Estimates) -> str | None:
        """Return a note that names the parameters on which the segments disagree, or None."""
        misfits = [f"{name} varies by {share:.0%}" for name, share in self.misfit.items()]
        if misfits:
            return (
                f"Kelvin-Voigt does not fit: {' and '.join(misfits)} between the {self.segments} "
                f"segments of {self.parameters.length:.2g} s, more than the noise of the fits"
            )
        return None
