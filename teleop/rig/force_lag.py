"""The lag of a force channel and the lost motion before its sensor, from a reference spring.

On a spring of stiffness k without damping the force is

    f = L(k play(x)) + c

with L a first-order lag tau, play the play operator of half width delta, and c an offset. Under a
sine of amplitude A and angular frequency omega both delay the force, as damping of -k tau and of
about -4 k delta / (pi omega A) does (Gelb and Vander Velde, Multiple-Input Describing Functions and
Nonlinear System Design, 1968, section 2.3). So a record separates them only if omega A, the speed
of the motion, differs within it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats
from estimation.estimator import LEVEL_95
from estimation.stiffening import Interval, lagged
from teleop.errors import InputError

LONGEST = 0.1
"""Longest lag that can be found [s]."""
SPEEDS = 1.3
"""Least ratio of fast to slow strokes with which a record separates lag and lost motion."""
STROKE = 0.02
"""Shortest stroke that is looked at, as a share of the range of the position."""
SETTLED = 0.3
"""Time until the start of the record is forgotten [s]."""
STEP = 0.02
"""Step of difference quotients, as a share of the parameter."""


class ForceLag(NamedTuple):
    """Lag of a force channel and lost motion, from a reference spring."""

    lag: Interval
    """Time constant of a first-order lag with its 95 % interval [s]."""
    lost_motion: Interval
    """How far the tip stays behind the encoder in either direction, with its interval [m]."""
    k: float
    """Stiffness of the spring [N/m]."""
    rms: float
    """Root mean square of the residual [N]."""
    separable: bool
    """Whether the record tells lag and lost motion apart. If not, the lag is that of a rig
    without lost motion, and the intervals hold whatever shares of the delay they have."""

    def summary(self) -> dict[str, Any]:
        """Return the result in the form of `teleop lag --json`, in SI units."""
        return {
            "lag_s": self.lag.value,
            "lag_low_s": self.lag.low,
            "lag_high_s": self.lag.high,
            "lost_motion_m": self.lost_motion.value if self.separable else None,
            "lost_motion_low_m": self.lost_motion.low,
            "lost_motion_high_m": self.lost_motion.high,
            "separable": self.separable,
            "k": self.k,
            "rms": self.rms,
        }


class SpringFit(NamedTuple):
    """Least squares of stiffness and offset with lag and lost motion given."""

    k: float
    """[N/m]"""
    residual: Floats
    """[N], of shape (n,) without the samples that are not settled."""

    @property
    def squared(self) -> float:
        """Mean square of the residual [N^2]."""
        return float(np.mean(self.residual**2))

    @property
    def independent(self) -> float:
        """Independent samples of the residual, by its correlation from one to the next."""
        r = self.residual
        correlation = max(0.0, float(r[1:] @ r[:-1]) / max(float(r @ r), 1e-300))
        return len(r) * (1.0 - correlation) / (1.0 + correlation)


class SpringRecord:
    """Position and force on a spring, ready to be fitted for any lag and lost motion."""

    def __init__(self, position: Floats, force: Floats, dt: Floats) -> None:
        self.position, self.dt = position, dt
        self.settled = slice(int(SETTLED / dt.mean()), None)
        self.force = force[self.settled]

    def fit(self, lag: float, lost_motion: float) -> SpringFit:
        """Fit the spring; a negative lost motion leads by as much as a positive one lags."""
        tip = play(self.position, abs(lost_motion))
        if lost_motion < 0.0:
            tip = 2.0 * self.position - tip
        x = lagged(tip, self.dt, lag)[self.settled]
        about = x - x.mean()
        f = self.force - self.force.mean()
        k = float(about @ f) / max(float(about @ about), 1e-300)
        return SpringFit(k, f - k * about)

    def slope(self, lag: float, lost_motion: float, lag_step: float, lost_step: float) -> Floats:
        """Change of the residual with lag or lost motion, where one step is nil."""
        ahead = self.fit(lag + lag_step, lost_motion + lost_step).residual
        return (ahead - self.fit(lag, lost_motion).residual) / (lag_step + lost_step)


def play(x: Floats, half_width: float) -> Floats:
    """Output of the play operator, which starts at the first sample, of shape (n,)."""
    if half_width == 0.0:
        return x
    out = np.empty_like(x)
    p = float(x[0])
    for i, value in enumerate(x.tolist()):
        if p < value - half_width:
            p = value - half_width
        elif p > value + half_width:
            p = value + half_width
        out[i] = p
    return out


def stroke_speeds(position: Floats, dt: Floats) -> Floats:
    """Speed of each stroke, from one turning point to the next [m/s]."""
    smooth = play(position, STROKE * float(np.ptp(position)))
    step = np.diff(smooth)
    moving = np.flatnonzero(step)
    turns = np.flatnonzero(np.diff(np.sign(step[moving]))) + 1
    strokes: list[NDArray[np.intp]] = np.split(moving, turns)[1:-1]
    return np.array([abs(step[s].sum()) / dt[s + 1].sum() for s in strokes])


def measure_lag(position: Floats, force: Floats, dt: Floats) -> ForceLag:
    """Fit lag and lost motion to a spring without damping.

    The reference must have no damping of its own: a steel spring.

    Parameters
    ----------
    position, force
        Displacement from the unloaded spring [m] and force [N], each of shape (n,).
    dt
        Time since the previous sample [s], shape (n,).

    Raises
    ------
    InputError
        Position or force is zero throughout, the stiffness is negative, or the lag with the
        smallest residual is close to zero or to `LONGEST`.
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
            f"the estimated stiffness of the spring is {fit.k:.4g} N/m: expected force and "
            "position to be positive in compression"
        )
    if not 1e-5 < alone < 0.99 * LONGEST:
        raise InputError(
            f"the estimated lag is {alone * 1e3:.2f} ms: expected 0.01 to {LONGEST * 1e3:g} ms, "
            "from a spring without damping, with the datum at the unloaded spring"
        )
    speeds = stroke_speeds(position, dt)
    equal = math.pi**2 / 8.0 * alone * float(np.mean(speeds)) if len(speeds) else 0.0
    if len(speeds) == 0 or np.quantile(speeds, 0.9) < SPEEDS * np.quantile(speeds, 0.1):
        return not_separated(record, alone, equal)
    scale = np.array([alone, equal])
    starts = (np.array([1.0, 0.0]), np.array([0.5, 0.5]))
    found = [
        least_squares(
            lambda z: record.fit(*(z * scale).tolist()).residual,
            start,
            bounds=((0.0, -3.0), (LONGEST / alone, 6.0)),
            diff_step=STEP,
        )
        for start in starts
    ]
    lag, lost = (min(found, key=lambda result: float(result.cost)).x * scale).tolist()
    fit = record.fit(lag, lost)
    slopes = [
        record.slope(lag, lost, STEP * alone, 0.0),
        record.slope(lag, lost, 0.0, STEP * equal),
    ]
    lag_half, lost_half = half_widths(fit, slopes)
    return ForceLag(
        Interval(lag, max(0.0, lag - lag_half), lag + lag_half),
        Interval(max(0.0, lost), max(0.0, lost - lost_half), max(0.0, lost + lost_half)),
        fit.k,
        fit.squared**0.5,
        True,
    )


def not_separated(record: SpringRecord, alone: float, equal: float) -> ForceLag:
    """The result of a record of one speed: lag and lost motion are bounded by either alone.

    Parameters
    ----------
    record
        The record.
    alone
        The lag that explains it without lost motion [s].
    equal
        The lost motion that delays about as much [m]; 0 where there is no stroke.
    """
    from scipy.optimize import minimize_scalar

    fit = record.fit(alone, 0.0)
    (lag_half,) = half_widths(fit, [record.slope(alone, 0.0, STEP * alone, 0.0)])
    lag = Interval(alone, 0.0, alone + lag_half)
    if equal == 0.0:
        return ForceLag(lag, Interval(0.0, 0.0, math.inf), fit.k, fit.squared**0.5, False)
    lost = float(
        minimize_scalar(
            lambda lost: record.fit(0.0, lost).squared, bounds=(0.0, 3.0 * equal), method="bounded"
        ).x
    )
    (half,) = half_widths(record.fit(0.0, lost), [record.slope(0.0, lost, 0.0, STEP * equal)])
    return ForceLag(lag, Interval(0.0, 0.0, lost + half), fit.k, fit.squared**0.5, False)


def half_widths(fit: SpringFit, slopes: list[Floats]) -> list[float]:
    """Half widths of the 95 % intervals of parameters, from slopes of the residual by them."""
    jacobian = np.stack(slopes, axis=1)
    variance = fit.squared * len(fit.residual) / max(fit.independent, 1.0)
    covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
    return [LEVEL_95 * math.sqrt(value) for value in np.diag(covariance).tolist()]
