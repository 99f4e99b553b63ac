"""Estimate damping and stiffness in each segment of a motion; test whether they are constant."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

from estimation.checks import check_correlation
from estimation.estimator import Estimates, Estimator
from estimation.method_settings import MethodSettings
from estimation.step import B, K, Regressors, State

SIGNIFICANT = 3.090232306167813
"""99.9 % quantile of the standard normal distribution."""
SMALLEST_REPORTED = 0.1
"""`misfit` contains a parameter if its standard deviation between segments is above this fraction
of its root mean square over the segments."""
FEWEST = 8
"""Smallest number of samples in a complete segment."""


@dataclass(frozen=True, slots=True)
class SegmentParameters:
    """Constant settings of the estimator `PooledSegments`."""

    length: float
    """Duration of a segment of the motion [s]."""
    correlation: float
    """Correlation length of the force noise, in samples, >= 1; 1 for white noise."""


@dataclass(slots=True)
class Pool:
    """Statistics of one parameter (b or k) over all segments of the motion.

    A segment is a time interval. In each segment, a least-squares fit gives an estimate of the
    parameter and the variance of this estimate.
    """

    count: int
    """Number of segments with a fit."""
    weights: float
    """Sum of the weights of the segments. A weight is 1 / variance."""
    weighted_mean: float
    """Weighted mean of the estimates of the parameter."""
    Q: float
    """Cochran's Q, the weighted sum of the squared deviations from the weighted mean."""
    mean: float
    """Unweighted mean of the estimates of the parameter."""
    squares: float
    """Unweighted sum of the squared deviations from the unweighted mean."""
    variance: float
    """Mean of the variances that the least-squares fits of the segments give."""


@dataclass(slots=True)
class SegmentState(State):
    """State of the estimator `PooledSegments`.

    The state contains sums of products of f, v and x over the samples of the present segment. The
    name of each sum is the product that is summed. For example, `fv` is the sum of f v. The
    statistics `b` and `k` contain the estimates of all earlier segments.
    """

    ff: float
    fv: float
    fx: float
    vv: float
    vx: float
    xx: float
    samples: int
    """Number of samples in the present segment."""
    elapsed: float
    """Time since the present segment began [s]."""
    b: Pool
    k: Pool


def step(
    parameters: SegmentParameters, state: SegmentState, phi: Regressors, f: float, dt: float
) -> None:
    """Add a sample to the present segment, and fit b and k when the segment is complete.

    A segment is a time interval of the motion. It is complete when it has the duration `length` and
    at least `FEWEST` samples. If the time `dt` since the previous sample is longer than `length`,
    the samples of the present segment are discarded, and a new segment starts.
    """
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
    """Start a new segment: set the sums, the number of samples and the elapsed time to zero."""
    state.ff = state.fv = state.fx = state.vv = state.vx = state.xx = 0.0
    state.samples = 0
    state.elapsed = 0.0


def end(parameters: SegmentParameters, state: SegmentState) -> None:
    """Fit b and k to the present segment by least squares, and add them to the statistics.

    The new estimates are the weighted means of b and of k over all segments. The segment is ignored
    if v and x are nearly proportional, because b and k can then not be distinguished.
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
    """Add the result of one segment to the statistics `pool` of a parameter (b or k).

    `value` is the least-squares estimate of the parameter in this segment, and `variance` is the
    variance of this estimate.
    """
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
    """Return the weighted mean of a parameter over the segments, and its standard deviation.

    The standard deviation contains the effect of noise. If the values of the parameter in the
    segments are significantly different, the standard deviation also contains the variance between
    the segments.
    """
    variance = 1.0 / pool.weights
    if disagree(pool):
        variance += spread(pool)
    return pool.weighted_mean, math.sqrt(variance)


def disagree(pool: Pool) -> bool:
    """Return True if the values of a parameter in the segments of the motion differ significantly.

    `pool` contains the statistics of the parameter (b or k). The difference is significant if
    Cochran's Q exceeds the 99.9 % quantile of the chi-squared distribution. Q is the weighted sum
    of the squared deviations from the weighted mean. The quantile is computed by the approximation
    of Wilson and Hilferty.
    """
    freedom = pool.count - 1
    if freedom < 1:
        return False
    third = 2.0 / (9.0 * freedom)
    root = 1.0 - third + SIGNIFICANT * math.sqrt(third)
    return freedom * root * root * root < pool.Q


def spread(pool: Pool) -> float:
    """Return the variance of the true value of a parameter between segments of the motion, >= 0.

    The estimates in the segments differ for two reasons: the true values differ, and noise causes
    errors. So the result is the variance of the estimates, minus the mean variance due to noise.
    """
    if pool.count < 2:
        return 0.0
    return max(pool.squares / (pool.count - 1) - pool.variance, 0.0)


class PooledSegments(Estimator):
    """Estimate b and k in each segment of the motion, and test whether b and k are constant.

    A segment is a time interval of the motion. A least-squares fit to the samples of each segment
    gives b and k with their variances. The estimate is the weighted mean over all segments.

    If the environment is a Kelvin-Voigt body (f = b v + k x), the results of the segments differ
    only by noise. Cochran's Q is the weighted sum of the squared deviations from the weighted mean.
    In this case, Q has a chi-squared distribution. If Q exceeds the 99.9 % quantile of this
    distribution, the parameter is not the same in all segments. This has two effects:

    - The standard deviation of the estimate includes the variance between the segments.
    - The property `misfit` contains the relative standard deviation between the segments, if this
      is above 10 %.

    A segment is ignored if v and x are nearly proportional, because b and k can then not be
    distinguished.

    Parameters
    ----------
    length
        Duration of a segment [s]. A suitable duration is about one period of the motion.
    correlation
        Correlation length of the force noise, in samples, see `LinearGainEstimator`.

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
    used_settings = ("segment",)
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

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(settings.segment, settings.correlation)

    @property
    def correlation(self) -> float:
        """Correlation length of the force noise, in samples, >= 1.

        The value is 1 for white noise. A new value is used for the segments of the motion that end
        after the change.

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
        """Number of segments of the motion in which b and k were estimated."""
        return self.state.b.count

    @property
    def misfit(self) -> dict[str, float]:
        """Relative standard deviation of b and of k between the segments of the motion.

        The keys are "b" and "k". A value is the standard deviation of the parameter between the
        segments, divided by the root mean square of the parameter. A parameter is included only if
        it differs significantly between the segments, and if the value is above 0.1
        (`SMALLEST_REPORTED`). So the dictionary is empty if the parameters do not vary.
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
        """Return a warning if b or k differs between the segments of the motion; otherwise None.

        The warning contains the parameters that are in the property `misfit`, with their values.
        """
        misfits = [f"{name} varies by {share:.0%}" for name, share in self.misfit.items()]
        if misfits:
            return (
                f"Kelvin-Voigt does not fit: {' and '.join(misfits)} between the {self.segments} "
                f"segments of {self.parameters.length:.2g} s, more than the noise of the fits"
            )
        return None
