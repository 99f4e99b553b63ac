"""Measure lag, lost motion and compliance of a rig with a reference spring.

Lost motion is the distance delta by which the tip is behind the encoder in each direction. If a
spring of stiffness k without damping is displaced by x, the measured force is

    f = L(k play(x)) + c

L is a pure delay of s tau followed by a first-order lag with time constant (1 - s) tau, with s from
0 to 1. play is the play operator (backlash) of half width delta, and c is an offset. tau is the lag
that is reported. At low frequencies, omega tau << 1, L delays a sine by tau for every s, so that
the correction of a recording needs only tau. s is fitted because it changes the force at the
highest frequencies of the record. A wrong s would change tau and delta.

Both L and play delay the force. The damping that is estimated from x and f is therefore not zero.
Let x be a sine of amplitude A and angular frequency omega, with omega tau << 1 and delta << A. The
lag then changes the estimated damping by -k tau. The lost motion changes the estimated damping by
about -4 k delta / (pi omega A). Only this second change depends on the speed omega A. Lag and lost
motion can therefore be separated only if the speed varies.

References
----------
A. Gelb, W. E. Vander Velde, "Multiple-Input Describing Functions and Nonlinear System Design",
McGraw-Hill, 1968, section 2.3.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.filters import Play
from estimation.quantities import STIFFNESS
from estimation.stiffening import Interval, evenly_lagged
from estimation.transmission import TransmissionCalibration
from sim_backend import Cube, Setup, paper_setup
from teleop.control.excitation_signals import Chirp
from teleop.errors import InputError
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

SPRING = 5000.0
"""Stiffness of the reference spring [N/m]."""
SPRING_DEPTH = 5e-3
"""Largest compression of the reference spring [m]."""


def measure_simulated_lag(seed: int = 0) -> tuple[ForceLag, Setup]:
    """Measure lag and lost motion of the simulated rig with a simulated reference spring."""
    spring = Cube(SPRING, 0.0, 1e-9)
    setup = replace(paper_setup("injector", "soft"), cube=spring, depth=SPRING_DEPTH)
    columns = run_trial(
        TrialSettings(
            condition="autonomous",
            clock="virtual",
            seed=seed,
            # up to 4 Hz: at higher frequencies, the ticks of 1 ms make the force notably smaller
            signal=Chirp(0.5, 4.0),
            custom_setup=setup,
        )
    ).columns
    measured = measure_lag(columns["slave_position"], columns["contact_force"], columns["dt"])
    return measured, setup


LONGEST = 0.1
"""Longest lag that can be measured [s]."""
NO_LAG = 1e-5
"""A lag below this value is not distinguished from 0 [s]."""
LARGEST_LEAD = 1e-4
"""Largest time by which the force may be ahead of the position of a channel without lag [s]."""
MOST_SAMPLES = 1_000_000
"""Largest number of samples of a file that is measured. All samples are in memory, and the fit
processes all of them many times."""
SPEEDS = 1.3
"""Smallest ratio of the 90 % to the 10 % quantile of the stroke speeds. A stroke is the motion from
one turning point to the next. Below this ratio, lag and lost motion cannot be separated."""
STROKE = 0.02
"""Half width of the play operator that removes small motions before strokes are detected, as a
fraction of the range of x."""
SETTLED = 0.3
"""Shortest time at the start that is not fitted, because of the transient of the lag [s]."""
STEP = 0.02
"""Step of a parameter in the numerical derivatives, as a fraction of the parameter's scale."""
BAND = 20
"""Half width of the mean over the values of a spectrum."""
FALSE_BAND = 0.01
"""Probability that noise of the position is taken for a part of the motion."""
REPLICATES = 60
"""Number of samples of the noise of the position, for the covariance."""
CHI_SQUARE_MEDIAN = 0.4549
"""Median of the chi-square distribution with one degree of freedom, whose mean is 1."""
ROLL_OFF = 0.5
"""Width of the range in which the filter of the position falls to 0, relative to the band."""
FINE = 1.0 / 128.0
"""Phase of the motion between two samples of the curve of the position [rad]. Linear interpolation
between them makes a sine smaller by its square / 12, which makes the stiffness 5e-6 too large."""
SHARE_ERROR = 0.5
"""Standard deviation of the share of the delay in the lag if the record does not determine it. The
share is between 0 and 1, and each of these values is within two standard deviations of all others.
"""
ANY_SHARE = Interval(0.0, 0.0, 1.0)
"""Share of the delay in a lag that is not separated from lost motion."""


class ForceLag(NamedTuple):
    """Measured lag of a force channel, and lost motion and compliance of a rig."""

    lag: Interval
    """Sum of the pure delay and of the time constant of the first-order lag of the force channel,
    with its 95 % confidence interval [s]."""
    lost_motion: Interval
    """Lost motion, with its 95 % confidence interval [m]. This is the distance by which the tip is
    behind the encoder position in each direction of motion."""
    k: Interval
    """Stiffness of spring and transmission in series, with its 95 % confidence interval [N/m]."""
    rms: float
    """Root mean square of the residual of the force [N]."""
    delay_share: Interval
    """Share of the pure delay in the lag, from 0 to 1, with its 95 % confidence interval."""
    separable: bool
    """Whether lag and lost motion can be separated. If not, `lag` is the estimate for zero lost
    motion. The confidence intervals then include every combination of lag and lost motion that
    causes the measured delay."""
    correlation: float = 0.0
    """Correlation of the errors of lag and lost motion; 0 if they are not separated."""

    def summary(self, stiffness: float | None = None) -> dict[str, Any]:
        """Return the results in SI units, with the keys of the JSON output of `teleop lag`.

        `stiffness` is that of the spring [N/m]; None if it is not known.
        """
        compliance = self.compliance(stiffness) if stiffness else None
        return {
            "lag_s": self.lag.value,
            "lag_low_s": self.lag.low,
            "lag_high_s": self.lag.high,
            "delay_share": self.delay_share.value if self.separable else None,
            "delay_share_low": self.delay_share.low,
            "delay_share_high": self.delay_share.high,
            "lost_motion_m": self.lost_motion.value if self.separable else None,
            "lost_motion_low_m": self.lost_motion.low,
            "lost_motion_high_m": self.lost_motion.high,
            "separable": self.separable,
            "k": self.k.value,
            "k_low": self.k.low,
            "k_high": self.k.high,
            "rms": self.rms,
            "compliance_m_per_n": compliance and compliance.value,
            "compliance_low_m_per_n": compliance and compliance.low,
            "compliance_high_m_per_n": compliance and compliance.high,
        }

    def compliance(self, stiffness: float) -> Interval:
        """Return the compliance between encoder and tip [m/N] with its 95 % confidence interval.

        `stiffness` is the known stiffness of the spring [N/m]. Raises InputError if the measured
        stiffness is larger than it, or not determined.
        """
        if self.k.low <= 0.0:
            raise InputError(
                "the stiffness of the spring is not determined: its 95 % interval contains zero"
            )
        low, value, high = (
            1.0 / k - 1.0 / stiffness for k in (self.k.high, self.k.value, self.k.low)
        )
        if high < 0.0:
            raise InputError(
                f"the measured stiffness is {STIFFNESS.text(self.k.value, '.5g')}: expected at "
                f"most that of the spring, {STIFFNESS.text(stiffness, '.5g')}"
            )
        return Interval(max(0.0, value), max(0.0, low), high)

    def calibration(self, stiffness: float | None = None) -> TransmissionCalibration:
        """Return the values with which recordings of the rig are corrected.

        Without `stiffness`, the compliance is unknown. Raises InputError if lag and lost motion
        could not be separated.
        """
        if not self.separable:
            raise InputError(
                "lag and lost motion cannot be measured separately: expected strokes of different "
                "speed, such as a chirp"
            )
        compliance = self.compliance(stiffness) if stiffness else Interval(0.0, 0.0, 0.0)
        share = self.delay_share
        return TransmissionCalibration(
            self.lag.value,
            self.lost_motion.value,
            compliance.value,
            self.lag.high - self.lag.value,
            self.lost_motion.high - self.lost_motion.value,
            compliance.high - compliance.value,
            share.value,
            max(share.high - share.value, share.value - share.low),
            self.correlation,
        )


class SpringFit(NamedTuple):
    """Fit of spring stiffness and force offset, with given lag and lost motion (backlash)."""

    k: float
    """Stiffness of the spring [N/m]."""
    residual: Floats
    """Residual of the force at each sample after the initial transient [N], shape (m,)."""
    tip: Floats
    """Position of the tip behind the lag, without its mean [m], shape (m,)."""

    @property
    def squared(self) -> float:
        """Mean square of the residual of the force [N^2]."""
        return float(np.mean(self.residual**2))


class SpringRecord:
    """Position and force that were recorded with a reference spring, to fit its stiffness.

    The play operator takes the extremes of its input. Noise of the position therefore moves its
    output in the direction of the motion, and a reversal between two samples is missed. For this
    reason, the position is a smooth curve through the samples (`Smoother`).
    """

    def __init__(self, position: Floats, force: Floats, dt: Floats) -> None:
        self.t = np.cumsum(dt) - dt[0]
        period = float(self.t[-1]) / (len(dt) - 1)
        if np.ptp(dt[1:]) > 1e-6 * period:
            from scipy.interpolate import CubicSpline

            even = np.linspace(0.0, self.t[-1], len(dt))
            position = np.asarray(CubicSpline(self.t, position)(even))
        self.smoother = Smoother(position, period)
        self.period = period / self.smoother.times
        self.strokes = Strokes(self.smoother.curve)
        self.all_force = force
        self.settle(0.0)

    def settle(self, lost_motion: float) -> None:
        """Fit only samples that depend neither on the start of the play nor on the ends."""
        curve, margin = self.smoother.curve, self.smoother.margin
        travel = np.maximum.accumulate(curve) - np.minimum.accumulate(curve)
        known = int(np.searchsorted(travel, 2.0 * abs(lost_motion))) * self.period
        last = float(self.t[-1])
        first = min(max(SETTLED, known + margin), 0.5 * last)
        fitted = (self.t >= first) & (self.t <= max(last - margin, 0.75 * last))
        self.settled, self.force = self.t[fitted], self.all_force[fitted]

    def tip(
        self,
        lag: float,
        lost_motion: float,
        share: float = 0.0,
        *,
        strokes: Strokes | None = None,
    ) -> Floats:
        """Return the position of the tip behind the lag at the fitted samples [m], without mean.

        `share` is the share of a pure delay in the lag, from 0 to 1. `strokes` is the motion, if it
        is not that of the record.
        """
        strokes = strokes or self.strokes
        tip = strokes.played(abs(lost_motion))
        if lost_motion < 0.0:
            tip = 2.0 * strokes.curve - tip
        if constant := (1.0 - share) * lag:
            tip = evenly_lagged(tip, self.period, constant)
        x = np.interp((self.settled - share * lag) / self.period, np.arange(len(tip)), tip)
        return np.asarray(x - x.mean())

    def fit(self, lag: float, lost_motion: float, share: float = 0.0) -> SpringFit:
        """Return the stiffness and the residuals of a fit with given lag, play and share."""
        x = self.tip(lag, lost_motion, share)
        f = self.force - self.force.mean()
        k = float(x @ f) / max(float(x @ x), 1e-300)
        return SpringFit(k, f - k * x, x)

    def lead(self, fit: SpringFit) -> float:
        """Return the time by which the force is ahead of the position, in a fit without lag [s]."""
        v = np.gradient(self.strokes.curve) / self.period
        v = np.interp(self.settled / self.period, np.arange(len(v)), v)
        return float(fit.residual @ v) / max(float(v @ v) * fit.k, 1e-300)

    def covariance(
        self,
        at: Sequence[float],
        steps: Sequence[float | None],
        known: Sequence[float] = (math.inf, math.inf, math.inf),
    ) -> Floats:
        """Return the covariance of the stiffness and of m parameters, shape (1 + m, 1 + m).

        The parameters are lag [s], lost motion [m] and share of the delay, in this order. `at`
        contains their values, `steps` the steps of the finite differences, and `known` the standard
        deviations with which they are known without the record. A parameter with the step None is
        left out.
        """
        fit = self.fit(*at)
        slopes, priors = [fit.tip], [math.inf]
        for i, step in enumerate(steps):
            if step is not None:
                ahead = self.tip(*(value + step * (i == j) for j, value in enumerate(at)))
                slopes.append(fit.k * (ahead - fit.tip) / step)
                priors.append(known[i])
        rng = np.random.default_rng(0)
        moved = (
            fit.k * (self.tip(*at, strokes=Strokes(self.smoother.noisy(rng))) - fit.tip)
            for _ in range(REPLICATES)
        )
        return covariance_of(fit.residual, np.array(slopes), np.array(priors), moved)


class Strokes:
    """A motion, split at its reversals for the play operator."""

    def __init__(self, curve: Floats) -> None:
        step = np.sign(np.diff(curve))
        turns = np.flatnonzero(step[1:] * step[:-1] <= 0.0) + 1
        self.curve = curve
        self.ends = curve[turns].tolist()
        self.lengths = np.diff([0, *turns, len(curve)])

    def played(self, half_width: float) -> Floats:
        """Return the output of a play operator: that of `estimation.filters.Play`."""
        if not half_width:
            return self.curve
        y, states = float(self.curve[0]), []
        for end in self.ends:
            states.append(y)
            y = min(max(y, end - half_width), end + half_width)
        states.append(y)
        held = np.repeat(states, self.lengths)
        return np.asarray(np.clip(held, self.curve - half_width, self.curve + half_width))


class Smoother:
    """A smooth curve through the samples of a position.

    The band of the motion ends where the power falls to that of the noise, which is the median of
    the upper half of all frequencies. Above this band, a filter without phase shift removes the
    noise. At both ends, the curve is continued by reflection at the line through the ends.
    """

    def __init__(self, position: Floats, period: float) -> None:
        from scipy.fft import dst
        from scipy.special import chdtri

        n = len(position)
        first, last = float(position[0]), float(position[-1])
        parts = np.asarray(dst((position - np.linspace(first, last, n))[1:-1], 1))
        frequency = np.arange(1, n - 1) / (2.0 * (n - 1) * period)
        self.noise = float(np.median(parts[n // 2 :] ** 2)) / CHI_SQUARE_MEDIAN
        count = 2 * BAND + 1
        least = self.noise * chdtri(count, FALSE_BAND / n) / count
        above = np.flatnonzero(smoothed(parts**2, BAND) > least)
        edge = float(frequency[above[-1]] if len(above) else frequency[-1])
        fall = np.clip((frequency / edge - 1.0) / ROLL_OFF, 0.0, 1.0)
        self.gain = 0.5 + 0.5 * np.cos(math.pi * fall)
        self.margin = 1.0 / edge
        """Time at each end that the reflection influences [s]."""
        parts *= self.gain
        fourth = (2.0 * math.pi * frequency) ** 4 @ parts**2 / max(float(parts @ parts), 1e-300)
        wanted = math.ceil(float(fourth) ** 0.25 * period / FINE)
        self.times = max(1, min(wanted, 2 * MOST_SAMPLES // n))
        """Number of samples of the curve in a sample period."""
        self.curve = self._curve(parts, first, last)
        """The curve [m], shape ((n - 1) times + 1,)."""

    def noisy(self, rng: np.random.Generator) -> Floats:
        """Return the curve with random noise, which the filter passes."""
        parts = self.gain * rng.normal(0.0, math.sqrt(self.noise), len(self.gain))
        return self.curve + self._curve(parts)

    def _curve(self, parts: Floats, first: float = 0.0, last: float = 0.0) -> Floats:
        from scipy.fft import idst

        padded = np.zeros((len(parts) + 1) * self.times - 1)
        padded[: len(parts)] = self.times * parts
        curve = np.concatenate([[0.0], np.asarray(idst(padded, 1)), [0.0]])
        return np.asarray(curve + np.linspace(first, last, len(curve)))


def smoothed(values: Floats, half: int) -> Floats:
    """Return the mean of each value and its neighbours, `half` on each side."""
    half = min(half, len(values) - 1)
    total = np.cumsum(np.concatenate([[0.0], np.pad(values, half, mode="reflect")]))
    width = 2 * half + 1
    return np.asarray((total[width:] - total[:-width]) / width)


def stroke_speeds(position: Floats, dt: Floats) -> Floats:
    """Return the mean speed [m/s] of each complete stroke, in a vector.

    A stroke is the motion from one turning point to the next. `position` [m] and `dt` (time since
    the previous sample [s]) have the shape (n,).
    """
    smooth = Play(STROKE * float(np.ptp(position))).run(position)
    step = np.diff(smooth)
    moving = np.flatnonzero(step)
    turns = np.flatnonzero(np.diff(np.sign(step[moving]))) + 1
    strokes: list[NDArray[np.intp]] = np.split(moving, turns)[1:-1]
    return np.array([abs(step[s].sum()) / dt[s + 1].sum() for s in strokes])


def measure_lag(position: Floats, force: Floats, dt: Floats) -> ForceLag:
    """Estimate lag and lost motion (backlash) from the position and force of a reference spring.

    The damping of the reference spring must be negligible, as for a steel spring.
    """
    from scipy.optimize import least_squares, minimize_scalar

    if not position.any() or not force.any():
        raise InputError("no lag to measure: position or force is zero throughout")
    record = SpringRecord(position, force, dt)
    alone = float(
        minimize_scalar(
            lambda lag: record.fit(lag, 0.0).squared,
            bounds=(0.0, LONGEST),
            method="bounded",
            options={"xatol": 1e-7},
        ).x
    )
    fit = record.fit(alone, 0.0)
    if fit.k <= 0.0:
        raise InputError(
            f"the estimated stiffness of the spring is {STIFFNESS.text(fit.k, '.4g')}: "
            "expected force and position to be positive in compression"
        )
    if not alone < 0.99 * LONGEST:
        raise InputError(
            f"the estimated lag is {alone * 1e3:.2f} ms: expected less than {LONGEST * 1e3:g} ms, "
            "from a spring without damping, with the datum at the unloaded spring"
        )
    if alone < NO_LAG and (lead := record.lead(fit)) > LARGEST_LEAD:
        raise InputError(
            f"the force is ahead of the position by {lead * 1e3:.2f} ms: expected a spring without "
            "damping"
        )
    alone = max(alone, NO_LAG)
    speeds = stroke_speeds(position, dt)
    equal = math.pi**2 / 8.0 * alone * float(np.mean(speeds)) if len(speeds) else 0.0
    if len(speeds) == 0 or np.quantile(speeds, 0.9) < SPEEDS * np.quantile(speeds, 0.1):
        return not_separated(record, alone, equal)
    scale = np.array([alone, equal, 1.0])

    def search(start: Floats) -> OptimizeResult:
        return least_squares(
            lambda z: record.fit(*(z * scale).tolist()).residual,
            start,
            bounds=((0.0, -3.0, 0.0), (LONGEST / alone, 6.0, 1.0)),
            diff_step=STEP,
        )

    starts = (np.array([1.0, 0.0, 0.5]), np.array([0.5, 0.5, 0.5]))
    found = min((search(start) for start in starts), key=lambda result: float(result.cost))
    count = len(record.settled)
    record.settle(found.x[1] * scale[1])
    if len(record.settled) < count:
        found = search(found.x)
    lag, lost, share = (found.x * scale).tolist()
    fit = record.fit(lag, lost, share)
    steps = (STEP * alone, STEP * equal, STEP if share < 0.5 else -STEP)
    covariance = record.covariance((lag, lost, share), steps, (math.inf, math.inf, SHARE_ERROR))
    k_half, lag_half, lost_half, share_half = half_widths(covariance)
    return ForceLag(
        Interval(lag, max(0.0, lag - lag_half), lag + lag_half),
        Interval(max(0.0, lost), max(0.0, lost - lost_half), max(0.0, lost + lost_half)),
        Interval(fit.k, fit.k - k_half, fit.k + k_half),
        fit.squared**0.5,
        Interval(share, max(0.0, share - share_half), min(1.0, share + share_half)),
        True,
        LEVEL_95**2 * float(covariance[1, 2]) / max(lag_half * lost_half, 1e-300),
    )


def not_separated(record: SpringRecord, alone: float, equal: float) -> ForceLag:
    """Return the result for a recording from which lag and lost motion cannot be separated.

    Lag and lost motion (backlash) both delay the force. The upper bound of the lag is computed with
    zero lost motion, and that of the lost motion with zero lag. The lower bounds are zero. The
    lost motion also makes the motion of the tip smaller, so that the interval of the stiffness
    contains both extremes. The lag is assumed to be of first order: a pure delay with the same
    phase is shorter, and therefore also in the interval.
    """
    from scipy.optimize import minimize_scalar

    fit = record.fit(alone, 0.0)
    k_half, lag_half = half_widths(record.covariance((alone, 0.0), (STEP * alone, None)))
    lag = Interval(alone, 0.0, alone + lag_half)
    if equal == 0.0:
        k = Interval(fit.k, fit.k - k_half, fit.k + k_half)
        return ForceLag(lag, Interval(0.0, 0.0, math.inf), k, fit.squared**0.5, ANY_SHARE, False)
    lost = float(
        minimize_scalar(
            lambda lost: record.fit(0.0, lost).squared, bounds=(0.0, 3.0 * equal), method="bounded"
        ).x
    )
    k_lost, half = half_widths(record.covariance((0.0, lost), (None, STEP * equal)))
    k = Interval(fit.k, fit.k - k_half, max(fit.k + k_half, record.fit(0.0, lost).k + k_lost))
    return ForceLag(lag, Interval(0.0, 0.0, lost + half), k, fit.squared**0.5, ANY_SHARE, False)


def covariance_of(
    residual: Floats, slopes: Floats, known: Floats, moved: Iterable[Floats] = ()
) -> Floats:
    """Return the covariance of m parameters of a least-squares fit, shape (m, m).

    `residual` has the shape (n,), and `slopes`, the derivatives of the model, the shape (m, n).
    `known` contains the standard deviation with which each parameter is known without the record.
    `moved` contains samples of the error of the model that noise of the position causes, each of
    shape (n,). The remaining noise is stationary, with any spectrum: only its power at the
    frequencies of the derivatives changes the parameters.
    """
    n = len(residual)
    slopes = slopes - slopes.mean(axis=1, keepdims=True)
    spectra = np.fft.rfft(slopes)
    weight = np.full(spectra.shape[1], 2.0 / n)
    weight[0] = 1.0 / n
    if n % 2 == 0:
        weight[-1] = 1.0 / n
    level = max(float(np.mean(residual**2)), 1e-300)
    prior = level / known**2
    size = np.sqrt(np.maximum(np.sum(slopes**2, axis=1) + prior, 1e-300))
    slopes, spectra = slopes / size[:, None], spectra / size[:, None]
    power = np.abs(np.fft.rfft(residual)) ** 2
    moved_power = np.zeros(len(power))
    spread = np.zeros((len(slopes), len(slopes)))
    for count, one in enumerate(moved, 1):  # not all at once: a record can have a million samples
        along = slopes @ one
        spread += (np.outer(along, along) - spread) / count
        moved_power += (np.abs(np.fft.rfft(one)) ** 2 - moved_power) / count
    noise = np.maximum(smoothed((power - moved_power) / n, BAND), 0.0)
    spread += np.real((spectra * (weight * noise)) @ spectra.conj().T)
    prior = np.diag(prior / size**2)
    inverse = np.linalg.pinv(slopes @ slopes.T + prior)
    covariance = inverse @ (spread + level * prior) @ inverse
    return np.asarray(covariance / np.outer(size, size))


def half_widths(covariance: Floats) -> list[float]:
    """Return the half width of the 95 % confidence interval of each estimated parameter."""
    return [LEVEL_95 * math.sqrt(value) for value in np.diag(covariance).tolist()]
