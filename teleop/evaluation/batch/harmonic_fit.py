"""Fit a sine and its harmonics to records with few samples per cycle, or with coarse rounding.

Smoothing and derivatives need many samples per cycle, and steps that are small compared with the
travel. A steady sine does not need them: the fundamentals of position and force are computed by
least squares from the measured samples at their own times, and their ratio is the complex stiffness
k' + i k''. The record is divided into blocks of whole cycles. The scatter of the blocks gives the
error due to noise.

**Rounding.** The rounding error of a sine is the same whenever the phase is the same. It therefore
has two effects that more cycles do not reduce. It changes the fundamental, by about the standard
deviation of the repeatable rounding error divided by the root of the number of different values
that are rounded. This number is limited by the number of different phases, and by the number of
steps that the signal passes. The second effect is that the residual contains harmonics, which are
not those of a body.

**Nonlinear bodies.** If position or force have harmonics that neither noise nor rounding explain,
the record is not evaluated in this way: the body is not linear, contact is lost, or the motion is
no sine. At few samples per cycle, higher harmonics appear at lower frequencies (aliasing). Those
that appear at the fundamental cannot be recognised.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import stdtrit

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.transmission import RIGID, TransmissionCalibration
from teleop.evaluation.batch.complex_stiffness import ComplexStiffness
from teleop.evaluation.batch.constancy import Cycles
from teleop.evaluation.batch.interference import Line
from teleop.evaluation.batch.thresholds import (
    COARSE_COUNTS,
    COARSE_SAMPLES_PER_CYCLE,
    FEWEST_HARMONIC_BLOCKS,
    FEWEST_HARMONIC_SAMPLES_PER_CYCLE,
    HARMONIC_BLOCK_CYCLES,
    LARGEST_AMPLITUDE_CHANGE,
    LARGEST_DISTORTION,
    LARGEST_HARMONIC,
    LARGEST_PHASE_CHANGE,
    LARGEST_REST,
    LEAST_LINE,
    LINE_FLOOR,
    LINE_WIDTH,
    MOST_HARMONIC_BLOCKS,
    ROUNDING_BINS,
)
from teleop.evaluation.reading.signals import Signals, repeated_rounding
from teleop.evaluation.reading.thresholds import ROUNDING_OF_STEP

Complex = NDArray[np.complex128]
WORST_ROUNDING = (LEVEL_95 * math.sqrt(2.0 / 12.0) * math.sqrt(2.0) / 0.53) ** 2
"""Number of independent rounding errors, multiplied by step and divided by amplitude, whose 95 %
interval is the largest error of the fundamental."""


@dataclass(frozen=True)
class Channel:
    """Fit of a sine and its harmonics to one channel, in blocks of whole cycles."""

    fundamental: Complex
    """Complex amplitude of the fundamental in each block."""
    middle: Floats
    """Mean of the channel in each block, without the harmonics."""
    rest: Floats
    """Samples of all blocks minus the fit."""
    harmonics: float
    """Root of the sum of the squared amplitudes of the harmonics, averaged over the blocks."""
    rounding: float
    """Standard deviation of the repeatable part of the rounding error."""
    noise: float
    """Standard deviation of the samples about the fit, including the rounding."""
    step: float
    """Resolution: the smallest step."""

    @property
    def amplitude(self) -> float:
        """Amplitude of the fundamental."""
        return float(np.abs(self.fundamental).mean())

    @property
    def distortion(self) -> float:
        """Harmonics that neither rounding nor noise explain, relative to the fundamental."""
        # Nearly all of the rounding error of a sine can be in a few harmonics. Its power is half of
        # the sum of the squared amplitudes, and at most 1.5 times its mean for a uniform error.
        rounded = math.sqrt(2.0 * 1.5) * self.rounding
        count = len(self.rest)
        by_noise = self.noise * math.sqrt(4.0 * (LARGEST_HARMONIC - 1) / count)
        allowed = math.hypot(rounded, 2.0 * by_noise)
        return math.sqrt(max(0.0, self.harmonics**2 - allowed**2)) / self.amplitude

    def rounding_errors(self, phases: int) -> tuple[float, float]:
        """Relative errors of the fundamental due to repeatable rounding: in phase, and across.

        They are standard deviations. `phases` is the number of different phases of the samples.
        With infinitely many phases, the rounding changes the fundamental, but not its phase. Two
        phases with nearly the same value have the same rounding error. The largest error of the
        amplitude A with the step s is then 0.53 / sqrt(2) (s / A)^1.5: the sum of the Fourier
        series of the rounding error, if the peaks are between two steps.
        """
        if self.rounding == 0.0:
            return 0.0, 0.0
        relative = math.sqrt(2.0) * self.rounding / self.amplitude
        passed = WORST_ROUNDING * self.amplitude / self.step
        return relative * math.sqrt(1.0 / phases + 1.0 / passed), relative / math.sqrt(phases)


@dataclass(frozen=True)
class HarmonicFit:
    """Complex stiffness of a steady sine in contact, from the fundamentals."""

    frequency: float
    """Frequency of the motion [Hz]."""
    stiffness: ComplexStiffness
    """Storage and loss stiffness with their 95 % intervals [N/m]."""
    rounding_error: float
    """Relative standard deviation of the storage stiffness due to repeatable rounding errors."""
    cycles: Cycles
    """Stiffness and damping of short blocks of cycles."""
    position: Channel
    """Fit to the position [m]."""
    force: Channel
    """Fit to the force [N]."""
    line: Line | None
    """Interference in the force, between the harmonics; None if there is none."""

    @property
    def drift(self) -> float:
        """Range of the slow change of the force [N]."""
        return float(np.ptp(self.force.middle))


def harmonic_fit(
    signals: Signals, transmission: TransmissionCalibration = RIGID
) -> HarmonicFit | None:
    """Return the complex stiffness of a coarsely sampled or rounded sine; None for other records.

    It is corrected for the force channel of `transmission`.
    """
    t = signals.t - signals.t[0]
    period = float(np.median(signals.dt))
    frequency = frequency_of(t, signals.x, period)
    if frequency is None:
        return None
    per_cycle = 1.0 / (frequency * period)
    step = resolution(signals.x) if signals.measured_step is None else signals.measured_step
    steps = step, resolution(signals.f)
    counts = min(
        float(np.ptp(values)) / max(step, 1e-300)
        for values, step in zip((signals.x, signals.f), steps, strict=True)
    )
    if per_cycle < FEWEST_HARMONIC_SAMPLES_PER_CYCLE or (
        per_cycle > COARSE_SAMPLES_PER_CYCLE and counts > COARSE_COUNTS
    ):
        return None
    whole = int(frequency * float(t[-1] + period))
    many = len(t) // (3 * (2 + 2 * LARGEST_HARMONIC))
    number = min(
        MOST_HARMONIC_BLOCKS, whole // HARMONIC_BLOCK_CYCLES, max(many, FEWEST_HARMONIC_BLOCKS)
    )
    if number < FEWEST_HARMONIC_BLOCKS:
        return None
    each = (whole // number) / frequency
    bounds = np.searchsorted(t, each * np.arange(number + 1))
    most = (int(min(np.diff(bounds))) // 2 - 2) // 2  # two samples for each parameter
    orders = resolved_orders(frequency, period, each)[: max(most, 0)]
    if not orders:
        return None
    x, f = (
        fit_channel(t, values, bounds, frequency, orders, step)
        for values, step in zip((signals.x, signals.f), steps, strict=True)
    )
    distortion = max(x.distortion, f.distortion)
    if distortion > LARGEST_DISTORTION or not is_steady(x):
        return None
    channel = transmission.response(2.0 * math.pi * frequency)
    lagged = x.fundamental * channel
    power = np.abs(lagged) ** 2
    whole_ratio = complex((f.fundamental @ lagged.conj()) / power.sum())
    ratios = f.fundamental / lagged
    size = abs(whole_ratio)
    phases = different_phases(frequency * t)
    inside, across = (
        math.hypot(*errors)
        for errors in zip(x.rounding_errors(phases), f.rounding_errors(phases), strict=True)
    )
    quantile = float(stdtrit(number - 1, 0.975)) / math.sqrt(number)
    halves = [
        math.hypot(quantile * float(np.std(part, ddof=1)), LEVEL_95 * size * error)
        + distortion * size
        for part, error in ((ratios.real, inside), (ratios.imag, across))
    ]
    found = ComplexStiffness(whole_ratio.real, halves[0], whole_ratio.imag, halves[1])
    cycles = blockwise(signals, frequency, channel)
    hum = line_of(f, period, frequency)
    return HarmonicFit(frequency, found, inside, cycles, x, f, hum)


def blockwise(signals: Signals, frequency: float, channel: complex) -> Cycles:
    """Return stiffness and damping of short blocks of cycles, to find changes in the record.

    `channel` is the frequency response of the force channel. The blocks are shorter than those of
    the harmonic fit, and only few harmonics are fitted.
    """
    t = signals.t - signals.t[0]
    period = float(np.median(signals.dt))
    whole = int(frequency * float(t[-1] + period))
    number = min(MOST_HARMONIC_BLOCKS, whole // HARMONIC_BLOCK_CYCLES)
    each = (whole // number) / frequency
    bounds = np.searchsorted(t, each * np.arange(number + 1))
    most = (int(min(np.diff(bounds))) // 2 - 2) // 2
    orders = resolved_orders(frequency, period, each)[: max(most, 1)]
    if not orders or most < 1:
        return Cycles(*(np.empty(0) for _ in Cycles._fields))
    x, f = (
        fit_channel(t, values, bounds, frequency, orders, 0.0).fundamental
        for values in (signals.x, signals.f)
    )
    omega = 2.0 * math.pi * frequency
    ratios = f / (x * channel)
    starts = signals.t[0] + each * np.arange(number)
    seconds = np.full(number, 1.0 / frequency)
    unknown = np.full(number, np.inf)
    travel = 2.0 * np.abs(x)
    return Cycles(starts, seconds, ratios.real, ratios.imag / omega, unknown, travel, travel)


def frequency_of(t: Floats, x: Floats, period: float) -> float | None:
    """Return the frequency of a sine [Hz], by least squares; None if there is no motion."""
    even = np.interp(np.arange(0.0, float(t[-1]) + 0.5 * period, period), t, x)
    trend = np.polynomial.polynomial.polyfit(t, x, 1)
    n = len(even)
    even = even - np.polynomial.polynomial.polyval(period * np.arange(n), trend)
    power = np.abs(np.fft.rfft(even * np.hanning(n))) ** 2
    peak = int(np.argmax(power))
    if peak == 0 or power[peak] == 0.0:
        return None
    moved = x - np.polynomial.polynomial.polyval(t, trend)

    def rest(frequency: float) -> float:  # squared, without the constant part
        columns = np.column_stack([np.ones_like(t), *waves(t, frequency)])
        theta = np.linalg.solve(columns.T @ columns, columns.T @ moved)
        return -float(moved @ columns @ theta)

    step = 1.0 / (n * period)
    bounds = ((peak - 1.0) * step, (peak + 1.0) * step)
    return float(minimize_scalar(rest, bounds=bounds, options={"xatol": 1e-5 * step}).x)


def waves(t: Floats, frequency: float) -> tuple[Floats, Floats]:
    """Return cosine and sine of a frequency at the times `t`."""
    angle = 2.0 * math.pi * frequency * t
    return np.cos(angle), np.sin(angle)


def resolved_orders(frequency: float, period: float, seconds: float) -> list[int]:
    """Return the orders of the harmonics that a block of `seconds` distinguishes from each other.

    Harmonics above half of the sampling rate appear at lower frequencies.
    """
    rate = 1.0 / period
    found: list[float] = []
    orders = []
    for order in range(1, LARGEST_HARMONIC + 1):
        seen = abs(order * frequency - round(order * frequency / rate) * rate)
        apart = min([abs(seen - one) for one in found], default=math.inf)
        if min(apart, seen, 2.0 * (0.5 * rate - seen)) > 0.9 / seconds:
            found.append(seen)
            orders.append(order)
        elif order == 1:
            return []
    return orders


def fit_channel(
    t: Floats,
    values: Floats,
    bounds: NDArray[np.intp],
    frequency: float,
    orders: list[int],
    step: float,
) -> Channel:
    """Fit mean, trend, fundamental and harmonics to each block of a channel."""
    amplitudes, middles, rests = [], [], []
    for start, end in pairwise(bounds):
        at = t[start:end]
        slow = (at - at.mean()) / max(float(np.ptp(at)), 1e-300)
        columns = [np.ones_like(at), slow]
        for order in orders:
            columns += waves(at, order * frequency)
        matrix = np.column_stack(columns)
        theta = np.linalg.lstsq(matrix, values[start:end], rcond=None)[0]
        amplitudes.append(theta[2::2] - 1j * theta[3::2])
        middles.append(theta[0])
        rests.append(values[start:end] - matrix @ theta)
    found = np.array(amplitudes)
    rest = np.concatenate(rests)
    spare = len(rest) - len(found) * (2 + 2 * len(orders))
    noise = math.sqrt(float(rest @ rest) / spare)
    # Each block has its own phase of the fundamental if the frequency varies a little.
    turned = found * (found[:, :1].conj() / np.abs(found[:, :1])) ** np.array(orders)
    harmonics = float(np.sqrt(np.sum(np.abs(turned.mean(axis=0)[1:]) ** 2)))
    if orders == [1]:  # harmonics are not distinguished from noise
        harmonics = math.sqrt(2.0) * noise
    # The rounding error of a few phases can have three times the mean variance of step^2 / 12.
    before = math.sqrt(max(noise**2 - step**2 / 4.0, 0.0) + step**2 / 12.0)
    rounding = repeated_rounding(step, before)
    return Channel(found[:, 0], np.array(middles), rest, harmonics, rounding, noise, step)


def is_steady(x: Channel) -> bool:
    """Return whether amplitude and phase of a motion are nearly constant, and it is a sine."""
    size = np.abs(x.fundamental)
    typical = float(np.median(size))
    phase = np.angle(x.fundamental / x.fundamental.mean())
    rest = math.sqrt(2.0 * max(0.0, float(x.rest @ x.rest) / len(x.rest) - 1.5 * x.step**2 / 12.0))
    # rounding also changes amplitude and phase of the blocks, if they have few samples
    rounded = 0.5 * x.step / typical
    return bool(
        np.abs(size / typical - 1.0).max() < LARGEST_AMPLITUDE_CHANGE + rounded
        and np.abs(phase).max() < LARGEST_PHASE_CHANGE + rounded
        and rest < LARGEST_REST * typical
    )


def different_phases(turns: Floats) -> int:
    """Return the number of different phases of samples; `turns` are their times in periods."""
    most = min(ROUNDING_BINS, len(turns))
    return min(
        len(np.unique(np.floor(most * (turns % 1.0) + shift) % most)) for shift in (0.0, 0.5)
    )


def resolution(values: Floats) -> float:
    """Return the smallest distance of two different values; 0 if all values are equal.

    Successive samples of a coarsely sampled motion can differ by many steps of the resolution.
    """
    gaps = np.diff(np.sort(values))
    gaps = gaps[gaps > ROUNDING_OF_STEP * float(np.max(np.abs(values), initial=0.0))]
    return float(gaps.min()) if len(gaps) else 0.0


def line_of(f: Channel, period: float, frequency: float) -> Line | None:
    """Return the largest line of interference in the rest of the force; None if there is none."""
    n = len(f.rest)
    window = np.hanning(n)
    size = np.abs(np.fft.rfft(window * f.rest)) * 2.0 / window.sum()
    i = int(np.argmax(size))
    harmonics = i * period**-1 / n / frequency
    least = max(2.0 * LEAST_LINE * f.amplitude, LINE_FLOOR * float(np.median(size)))
    # Harmonics that are not fitted, and the rounding, also give lines.
    near = abs(harmonics - round(harmonics)) * frequency * n * period < LINE_WIDTH
    if size[i] < least + 2.0 * f.rounding or near:
        return None
    return Line(float(harmonics * frequency), float(size[i]), 0)
