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
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.filters import Play
from estimation.quantities import STIFFNESS
from estimation.stiffening import Interval, lagged
from estimation.transmission import TransmissionCalibration
from sim_backend import Cube, Setup, paper_setup
from teleop.control.excitation_signals import Chirp
from teleop.errors import InputError
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

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
            signal=Chirp(1.0, 8.0),
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
"""Time at the start of the record that is not fitted, because of the transient of the lag [s]."""
STEP = 0.02
"""Step of a parameter in the numerical derivatives, as a fraction of the parameter's scale."""
SHARE_ERROR = 0.5
"""Standard deviation of the share of the delay in the lag if the record does not determine it. The
share is between 0 and 1, and each of these values is within two standard deviations of all others.
"""


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
    separable: bool
    """Whether lag and lost motion can be separated. If not, `lag` is the estimate for zero lost
    motion. The confidence intervals then include every combination of lag and lost motion that
    causes the measured delay."""

    def summary(self, stiffness: float | None = None) -> dict[str, Any]:
        """Return the results in SI units, with the keys of the JSON output of `teleop lag`.

        `stiffness` is that of the spring [N/m]; None if it is not known.
        """
        compliance = self.compliance(stiffness) if stiffness else None
        return {
            "lag_s": self.lag.value,
            "lag_low_s": self.lag.low,
            "lag_high_s": self.lag.high,
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
        return TransmissionCalibration(
            *(one.value for one in (self.lag, self.lost_motion, compliance)),
            *(one.high - one.value for one in (self.lag, self.lost_motion, compliance)),
        )


class SpringFit(NamedTuple):
    """Fit of spring stiffness and force offset, with given lag and lost motion (backlash)."""

    k: float
    """Stiffness of the spring [N/m]."""
    residual: Floats
    """Residual of the force at each sample after the initial transient [N], shape (m,)."""
    spread: float
    """Standard deviation of the position of the tip [m]."""

    @property
    def squared(self) -> float:
        """Mean square of the residual of the force [N^2]."""
        return float(np.mean(self.residual**2))

    @property
    def independent(self) -> float:
        """Effective sample size: number of residuals, reduced because of their autocorrelation."""
        r = self.residual
        correlation = max(0.0, float(r[1:] @ r[:-1]) / max(float(r @ r), 1e-300))
        return len(r) * (1.0 - correlation) / (1.0 + correlation)

    @property
    def variance(self) -> float:
        """Variance of a residual, increased because of the autocorrelation [N^2]."""
        return self.squared * len(self.residual) / max(self.independent, 1.0)

    def k_interval(self, further: float = 0.0) -> Interval:
        """Return the stiffness with its 95 % confidence interval [N/m].

        `further` is the variance of k that the errors of lag and lost motion cause [N^2/m^2].
        """
        alone = self.variance / (len(self.residual) * self.spread**2)
        half = LEVEL_95 * math.sqrt(alone + further)
        return Interval(self.k, self.k - half, self.k + half)


class SpringRecord:
    """Position and force that were recorded with a reference spring, to fit its stiffness."""

    def __init__(self, position: Floats, force: Floats, dt: Floats) -> None:
        self.position, self.dt = position, dt
        self.t = np.cumsum(dt)
        self.settled = slice(int(SETTLED / dt.mean()), None)
        self.force = force[self.settled]

    @cached_property
    def curve(self) -> CubicSpline:
        """The position as a function of time, to delay it by a part of a sample period."""
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.t, self.position)

    def delayed(self, delay: float) -> Floats:
        """Return the position, delayed by a time [s], at all samples [m]."""
        if delay == 0.0:
            return self.position
        return np.asarray(self.curve(np.maximum(self.t - delay, self.t[0])))

    def fit(self, lag: float, lost_motion: float, share: float = 0.0) -> SpringFit:
        """Return the stiffness and the residuals of a fit with given lag and play.

        `share` is the share of a pure delay in the lag, from 0 to 1.
        """
        position = self.delayed(share * lag)
        tip = Play(abs(lost_motion)).run(position)
        if lost_motion < 0.0:
            tip = 2.0 * position - tip
        x = lagged(tip, self.dt, (1.0 - share) * lag)[self.settled]
        about = x - x.mean()
        f = self.force - self.force.mean()
        k = float(about @ f) / max(float(about @ about), 1e-300)
        return SpringFit(k, f - k * about, max(float(np.std(about)), 1e-300))

    def lead(self, fit: SpringFit) -> float:
        """Return the time by which the force is ahead of the position, in a fit without lag [s]."""
        v = (np.gradient(self.position) / self.dt)[self.settled]
        return float(fit.residual @ v) / max(float(v @ v) * fit.k, 1e-300)

    def derivatives(
        self, at: Sequence[float], steps: Sequence[float | None]
    ) -> tuple[list[Floats], Floats]:
        """Return the derivatives of the residual at each sample, and those of the stiffness.

        They are finite differences with respect to lag [s], lost motion [m] and share of the delay,
        in this order. `at` contains the values of these parameters, and `steps` the steps. A
        parameter with the step None is left out.
        """
        here = self.fit(*at)
        residuals, stiffnesses = [], []
        for i, step in enumerate(steps):
            if step is not None:
                ahead = self.fit(*(value + step * (i == j) for j, value in enumerate(at)))
                residuals.append((ahead.residual - here.residual) / step)
                stiffnesses.append((ahead.k - here.k) / step)
        return residuals, np.array(stiffnesses)


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
    starts = (np.array([1.0, 0.0, 0.5]), np.array([0.5, 0.5, 0.5]))
    found = [
        least_squares(
            lambda z: record.fit(*(z * scale).tolist()).residual,
            start,
            bounds=((0.0, -3.0, 0.0), (LONGEST / alone, 6.0, 1.0)),
            diff_step=STEP,
        )
        for start in starts
    ]
    lag, lost, share = (min(found, key=lambda result: float(result.cost)).x * scale).tolist()
    fit = record.fit(lag, lost, share)
    steps = (STEP * alone, STEP * equal, STEP if share < 0.5 else -STEP)
    slopes, by_errors = record.derivatives((lag, lost, share), steps)
    covariance = covariance_of(fit, slopes, (math.inf, math.inf, SHARE_ERROR))
    lag_half, lost_half, _ = half_widths(covariance)
    return ForceLag(
        Interval(lag, max(0.0, lag - lag_half), lag + lag_half),
        Interval(max(0.0, lost), max(0.0, lost - lost_half), max(0.0, lost + lost_half)),
        fit.k_interval(float(by_errors @ covariance @ by_errors)),
        fit.squared**0.5,
        True,
    )


def not_separated(record: SpringRecord, alone: float, equal: float) -> ForceLag:
    """Return the result for a recording from which lag and lost motion cannot be separated.

    Lag and lost motion (backlash) both delay the force. The upper bound of the lag is computed with
    zero lost motion, and that of the lost motion with zero lag. The lower bounds are zero. The lag
    is assumed to be of first order: a pure delay with the same phase is shorter, and therefore also
    in the interval.
    """
    from scipy.optimize import minimize_scalar

    fit = record.fit(alone, 0.0)
    slopes, _ = record.derivatives((alone, 0.0), (STEP * alone,))
    (lag_half,) = half_widths(covariance_of(fit, slopes))
    lag = Interval(alone, 0.0, alone + lag_half)
    if equal == 0.0:
        lost_motion = Interval(0.0, 0.0, math.inf)
        return ForceLag(lag, lost_motion, fit.k_interval(), fit.squared**0.5, False)
    lost = float(
        minimize_scalar(
            lambda lost: record.fit(0.0, lost).squared, bounds=(0.0, 3.0 * equal), method="bounded"
        ).x
    )
    slopes, _ = record.derivatives((0.0, lost), (None, STEP * equal))
    (half,) = half_widths(covariance_of(record.fit(0.0, lost), slopes))
    lost_motion = Interval(0.0, 0.0, lost + half)
    return ForceLag(lag, lost_motion, fit.k_interval(), fit.squared**0.5, False)


def covariance_of(
    fit: SpringFit, slopes: list[Floats], known: Sequence[float] | None = None
) -> Floats:
    """Return the covariance of m parameters from the derivatives of the residual, shape (m, m).

    `known` contains the standard deviation with which each parameter is known without the record.
    """
    jacobian = np.stack(slopes, axis=1)
    information = jacobian.T @ jacobian / max(fit.variance, 1e-300)
    if known is not None:
        information += np.diag(1.0 / np.array(known) ** 2)
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    size = np.outer(size, size)
    return np.asarray(np.linalg.pinv(information / size) / size)


def half_widths(covariance: Floats) -> list[float]:
    """Return the half width of the 95 % confidence interval of each estimated parameter."""
    return [LEVEL_95 * math.sqrt(value) for value in np.diag(covariance).tolist()]
