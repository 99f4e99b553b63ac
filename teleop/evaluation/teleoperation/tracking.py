"""Compute how well a position follows a sinusoidal target."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from teleop.evaluation.teleoperation.thresholds import (
    FEWEST_PERIODS,
    FREQUENCY_SPAN,
    INCOMPLETE_PERIOD,
    LARGEST_LEAD,
)

SAMPLES, PADDING = 64, 8
"""For the search for the achieved frequency: samples per period of the target, and factor by which
zero-padding lengthens the signal."""
COLUMNS = {
    "gain": "tracking gain",
    "phase_deg": "tracking phase [deg]",
    "rms_m": "tracking error rms [m]",
    "frequency_hz": "achieved frequency [Hz]",
    "target_hz": "target frequency [Hz]",
}
"""Headings of the tracking values in tables with one row per recording. The values are empty if
there is no target."""


class Tracking(NamedTuple):
    """Numbers that describe how well a position follows a sinusoidal target.

    Gain, phase and delay are values at the frequency of the target.
    """

    gain: float
    """Amplitude of the position divided by the amplitude of the target."""
    phase_deg: float
    """Phase of the position relative to the target [deg]; negative for a lag. The largest value is
    360 times `LARGEST_LEAD`. All values are within 360 deg below this value."""
    delay_s: float
    """Delay of the position relative to the target [s], computed from the phase; negative for a
    lead."""
    rms_m: float
    """Root mean square of the tracking error, which is position minus target [m]."""
    frequency_hz: float
    """Frequency of the sine that fits the position best [Hz]."""
    target_hz: float
    """Frequency of the target [Hz]."""
    periods: int
    """Number of periods of the target that were evaluated."""


def tracking(t: Floats, target: Floats, position: Floats, frequency: float) -> Tracking | None:
    """Return gain, phase and error of a position relative to a sinusoidal target.

    The result is None if the target moves for less than `FEWEST_PERIODS` periods.

    The first period of the target is omitted, because the position starts to move in this period.
    After it, the largest possible number of whole periods is evaluated. The last of these periods
    ends when the target stops. Sines and a linear trend are fitted by least squares.
    """
    moves = np.flatnonzero(np.abs(np.diff(target)) > 0.0)  # not where the target is NaN
    if not len(moves):
        return None
    first, last = int(moves[0]), int(moves[-1]) + 1
    duration = float(t[last] - t[first])
    if duration * frequency < FEWEST_PERIODS - INCOMPLETE_PERIOD:
        return None
    periods = math.floor(duration * frequency - 1.0 + INCOMPLETE_PERIOD)
    used = slice(int(np.searchsorted(t, t[last] - periods / frequency)), last + 1)
    t, target, position = t[used], target[used], position[used]
    ratio = phasor(t, position, frequency) / phasor(t, target, frequency)
    cycles = (math.degrees(float(np.angle(ratio))) / 360.0 - LARGEST_LEAD) % -1.0 + LARGEST_LEAD
    return Tracking(
        gain=abs(ratio),
        phase_deg=360.0 * cycles,
        delay_s=-cycles / frequency,
        rms_m=float(np.sqrt(np.mean((position - target) ** 2))),
        frequency_hz=achieved_frequency(t, position, frequency),
        target_hz=frequency,
        periods=periods,
    )


def design(t: Floats, frequency: float) -> Floats:
    """Return the regressors for a least-squares fit of a sine, of shape (n, 4).

    The columns are a cosine, a sine, a constant and a linear trend over time.
    """
    angle = 2.0 * math.pi * frequency * t
    middle = t - np.mean(t)
    return np.stack([np.cos(angle), np.sin(angle), np.ones_like(t), middle], axis=1)


def phasor(t: Floats, x: Floats, frequency: float) -> complex:
    """Return the complex amplitude of the sine of the given frequency that fits a signal best.

    The sine is the real part of c exp(2 pi j frequency t), where c is the complex amplitude. An
    offset and a linear trend are fitted together with the sine.
    """
    (cosine, sine, *_), *_ = np.linalg.lstsq(design(t, frequency), x)
    return complex(cosine, -sine)


def achieved_frequency(t: Floats, position: Floats, frequency: float) -> float:
    """Return the frequency of the sine that fits a position best [Hz]."""
    from scipy.optimize import minimize_scalar

    duration = float(t[-1] - t[0])
    count = max(round(SAMPLES * duration * frequency), SAMPLES)
    even = np.linspace(t[0], t[-1], count)
    x = np.interp(even, t, position)
    x -= np.mean(x)

    def squared_error(f: float) -> float:
        regressors = design(even, f)
        found = np.linalg.lstsq(regressors, x)[0]
        return float(np.sum((x - regressors @ found) ** 2))

    padded = PADDING * count
    frequencies = np.fft.rfftfreq(padded, duration / (count - 1))
    searched = (frequencies >= frequency / FREQUENCY_SPAN) & (
        frequencies <= frequency * FREQUENCY_SPAN
    )
    power = np.where(searched, np.abs(np.fft.rfft(x, padded)), 0.0)
    best, half_step = float(frequencies[int(np.argmax(power))]), 0.5 / duration
    bounds = (max(best - half_step, 0.1 * best), best + half_step)
    return float(minimize_scalar(squared_error, bounds=bounds, method="bounded").x)
