"""Prepare a record for batch evaluation: resample it evenly, and smooth it without delay.

1. The record is interpolated linearly onto a grid of constant period (`resample`).
2. If the sampling rate is much higher than necessary for the bandwidth of the force, successive
   samples are averaged in blocks.
3. Position and force are smoothed with the same Gaussian kernel (`estimation.smoothing`). If the
   relation between the measured signals is linear, such as f = b v + k x, it also holds for the
   smoothed signals, with the same b and k.

The corner (half-power) frequency of the kernel is `SMOOTHING_CORNER` times the upper end of the
coherent band, or lower if the sampling rate is low. The coherent band is the band of frequencies in
which the force follows the displacement (`estimation.coherent_band`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter

from estimation.arrays import Floats
from estimation.baseline import FEWEST_CYCLES, baseline_order, without_baseline
from estimation.coherent_band import CoherentBand, block_means, coherent_band
from estimation.filters import Lag
from estimation.smoothing import kernel_width, slope, smooth, smooth_pieces
from estimation.transmission import RIGID, TransmissionCalibration
from teleop.evaluation.batch.strokes import (
    combined,
    cycle_frequency,
    is_sweep,
    stroke_band,
    turning_points,
)
from teleop.evaluation.batch.thresholds import FEWEST_IN_PIECE, SINE_SHARE, SMOOTHING_CORNER
from teleop.evaluation.reading.signals import Signals, repeated_rounding, smallest_step


@dataclass(frozen=True)
class ResampledRecord:
    """A record that is interpolated onto a grid of constant period, but not smoothed.

    Gaps, in which samples are missing, divide the record into pieces.
    """

    pieces: list[tuple[Floats, Floats, Floats]]
    """Time [s], position [m] and force [N] of each piece, as arrays of shape (n,)."""
    period: float
    """Grid period [s]."""
    band: CoherentBand
    """Frequency band in which the force follows the position, computed from the longest piece."""
    ramp: bool
    """Whether `band` is computed from the duration of a motion that never reverses, such as a ramp
    (`teleop.evaluation.batch.strokes`). False if it is computed from the spectra."""
    x_noise: float
    """Standard deviation of the noise of the position [m], of the longest piece."""
    f_noise: float
    """Standard deviation of the noise of the force [N], of the longest piece."""
    step: float
    """Smallest step of the position on the grid [m], of the longest piece."""
    count: float
    """Resolution of the position: its smallest step [m]; 0 if the position never changes."""
    f_count: float
    """Resolution of the force: its smallest step [N]; 0 if the force never changes."""
    force_lag: float
    """Time constant of the force channel that is compensated [s]; 0 if no lag is compensated."""
    filter_delay: float
    """Delay of a filter of the force that is compensated [s]; 0 without one."""
    compliance: float
    """Calibrated compliance between encoder and tip [m/N]; 0 if it is not known."""


def resample(signals: Signals, transmission: TransmissionCalibration = RIGID) -> ResampledRecord:
    """Interpolate a record linearly onto a grid of constant period.

    Gaps, in which samples are missing, divide the record into pieces. Each piece is interpolated
    separately.
    """
    period = float(np.median(signals.dt))
    bounds = sorted({0, len(signals.t), *signals.gaps})
    pieces = []
    for start, end in pairwise(bounds):
        t = signals.t[start:end]
        count = int(np.floor((t[-1] - t[0]) / period + 0.5)) + 1 if len(t) > 1 else 1
        if count < FEWEST_IN_PIECE:
            continue
        even = t[0] + period * np.arange(count)
        f = np.interp(even, t, signals.f[start:end])
        # the position gets the same lag as the force: both signals are then in phase
        x = np.interp(even - transmission.delay, t, signals.x[start:end])
        x = Lag(transmission.time_constant).run(x, np.full(count, period))
        pieces.append((even, x, f))
    if not pieces:
        raise ValueError(
            f"no piece between gaps has {FEWEST_IN_PIECE} samples or more: expected longer pieces"
        )
    even, x, f = max(pieces, key=lambda piece: len(piece[0]))
    longest = slice(*max(pairwise(bounds), key=lambda ends: ends[1] - ends[0]))
    t = signals.t[longest]
    x_noise, f_noise = (
        measurement_noise(even_values) * noise_lost(t, values[longest], even)
        for even_values, values in ((x, signals.x), (f, signals.f))
    )
    spectral = coherent_band(x, f, period)
    stroke = stroke_band(x, f, period, x_noise)
    band = combined(spectral, stroke) if stroke else spectral
    return ResampledRecord(
        pieces,
        period,
        band,
        ramp=band is stroke,
        x_noise=x_noise,
        f_noise=f_noise,
        step=smallest_step(x),
        count=signals.step,
        f_count=signals.force_step,
        force_lag=transmission.force_lag,
        filter_delay=signals.filter_delay,
        compliance=transmission.compliance,
    )


def measurement_noise(values: Floats, t: Floats | None = None) -> float:
    """Estimate the standard deviation of the white noise in a signal, in the unit of the signal.

    It is computed from the third differences of the signal: divided differences at the times `t`,
    if these are given. The differences remove slow motion, but not the noise (Gasser, Sroka and
    Jennen-Steinmetz, Biometrika 73(3), 1986).
    """
    if t is None:
        return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / np.sqrt(20.0))
    times, four = (np.lib.stride_tricks.sliding_window_view(one, 4) for one in (t, values))
    apart = times[:, :, None] - times[:, None, :] + np.eye(4)
    weights = 1.0 / np.prod(apart, axis=2)
    rest = np.sum(weights * (four - four[:, :1]), axis=1) / np.linalg.norm(weights, axis=1)
    return float(1.4826 * np.median(np.abs(rest)))


def noise_lost(t: Floats, values: Floats, even: Floats) -> float:
    """Return the noise of measured values, relative to that after interpolation to even times."""
    after = measurement_noise(np.interp(even, t, values))
    return max(1.0, measurement_noise(values, t) / after) if after else 1.0


FINENESS = 4.0
"""Smallest number of grid points per standard deviation of the smoothing kernel, if the sampling
rate of the record is high enough."""
OUTLIERS = 5
"""Length of the median filter that removes outliers before the fundamental share is computed
[samples]."""


@dataclass(frozen=True)
class SmoothedRecord:
    """A record that is prepared for the batch evaluation: position and force at n times.

    The times have a constant period, except at gaps, where samples are missing. The object contains
    the measured and the smoothed signals. All arrays have shape (n,).
    """

    t: Floats
    """Time [s]."""
    raw_x: Floats
    """Measured position, averaged over a grid period [m]. It is delayed by `force_lag`, so that it
    has the same lag as the force."""
    raw_f: Floats
    """Measured force, averaged over a grid period [N]."""
    x: Floats
    """Smoothed position [m]."""
    v: Floats
    """Derivative of the smoothed position [m/s]."""
    f: Floats
    """Smoothed force [N]."""
    period: float
    """Grid period [s]."""
    width: float
    """Width (standard deviation) of the smoothing kernel [s]."""
    band: CoherentBand
    """Band of frequencies in which the force follows the displacement."""
    starts: tuple[int, ...]
    """Index of the first sample of each piece between gaps."""
    x_noise: float
    """Standard deviation of the noise of the measured position, including quantisation [m]."""
    f_noise: float
    """Standard deviation of the noise of the measured force [N]."""
    count: float
    """Resolution of the position: its smallest step [m]; 0 if the position never changes."""
    f_count: float
    """Resolution of the force: its smallest step [N]; 0 if the force never changes."""
    f_rounding: float
    """Standard deviation of the repeatable part of the rounding error of the force [N]. This part
    is the same whenever the force has the same value."""
    ramp: bool
    """Whether `band` is computed from the duration of a motion that never reverses, such as a ramp
    (`teleop.evaluation.batch.strokes`). False if it is computed from the spectra."""
    force_lag: float
    """Time constant of the force channel that is compensated [s]; 0 if no lag is compensated."""
    filter_delay: float
    """Delay of a filter of the force that is compensated [s]; 0 without one."""
    compliance: float
    """Calibrated compliance between encoder and tip [m/N]; 0 if it is not known."""
    sampling_period: float
    """Period of the measured samples, of which several are averaged in a grid period [s]."""

    @cached_property
    def clock(self) -> Floats:
        """Time since the first sample, without the duration of gaps [s], shape (n,)."""
        return np.asarray(self.period * np.arange(len(self.t)), dtype=np.float64)

    @cached_property
    def force_range(self) -> tuple[float, float]:
        """Lowest and highest smoothed force without outliers [N]: percentiles 0.5 and 99.5."""
        low, high = (float(v) for v in np.percentile(self.f, [0.5, 99.5]))
        return low, high

    @cached_property
    def order(self) -> int:
        """Number of cosines in the baseline.

        The baseline is the part of position and force that is slower than the palpation. It is
        computed as a sum of cosines (`estimation.baseline`). The number is 0, and no baseline is
        subtracted, if the motion has fewer than `FEWEST_CYCLES` cycles, or if the force does not
        follow the displacement.
        """
        order = baseline_order(self.band.low, float(self.clock[-1]))
        if order == 0 or self.band.coherence == 0.0:
            return 0
        fast = float(np.std(without_baseline(self.x, order)))
        turns = turning_points(self.x, fast)
        return order if len(turns) - 2 >= 2 * FEWEST_CYCLES else 0

    @cached_property
    def fundamental_share(self) -> float:
        """Share of the fundamental frequency in the power of the motion, from 0 to 1.

        The share is 1 for a sinusoidal motion. The fundamental frequency f1 is the frequency at
        which the spectrum of the velocity has its maximum. The share is the power near f1 (from
        0.5 f1 to 1.5 f1), divided by the power from 0 to 10 f1. It is computed from the velocity
        and from the position, and the smaller one is used. The share of the velocity is smaller if
        the motion is a triangle wave, or if it contains holds or tremor of the hand. The share of
        the position is smaller if the motion contains lower frequencies, such as a multisine or a
        random motion, whose velocity is mainly at the highest frequencies. Single outliers of the
        position are removed before. The share is NaN if the motion has fewer than about
        `FEWEST_CYCLES` cycles.
        """
        x = median_filter(self.raw_x, OUTLIERS, mode="nearest")
        x = without_baseline(x, self.order)
        if len(turning_points(x, float(np.std(x)))) - 2 < 2 * FEWEST_CYCLES - 1:
            return math.nan
        window = np.hanning(len(x))
        of_v, of_x = (
            np.abs(np.fft.rfft((y - y.mean()) * window)[1:]) ** 2 for y in (self.derivative(x), x)
        )
        ratio = np.arange(1, len(of_v) + 1) / (1 + np.argmax(of_v))
        near, counted = (ratio > 0.5) & (ratio < 1.5), ratio < 10.0
        return min(float(power[near].sum() / power[counted].sum()) for power in (of_v, of_x))

    @cached_property
    def sinusoidal(self) -> bool:
        """Whether the motion counts as a sine.

        It does if `fundamental_share` is larger than `SINE_SHARE`, and the frequency of the cycles
        is nearly constant.
        """
        return self.fundamental_share > SINE_SHARE and not is_sweep(self.palpation)

    @cached_property
    def frequency(self) -> float:
        """Frequency of the palpation [Hz]; NaN if the motion is not periodic.

        The motion counts as not periodic if `order` is 0 and `sinusoidal` is False.
        """
        if self.order == 0 and not self.sinusoidal:
            return float("nan")
        return cycle_frequency(self.palpation, self.period) or self.band.centre

    @cached_property
    def palpation(self) -> Floats:
        """Smoothed position minus its baseline [m], shape (n,).

        The baseline is the part of the position that is slower than the palpation.
        """
        return without_baseline(self.x, self.order)

    def smoothed(self, values: Floats) -> Floats:
        """Smooth a signal with the same Gaussian kernel as the record, and return it, shape (n,).

        The parameter `values` contains the signal at the times `t`, shape (n,). Each piece between
        two gaps is smoothed separately.
        """
        return smooth_pieces(values, self.starts, self.width / self.period)

    def derivative(self, values: Floats) -> Floats:
        """Return the time derivative of a smoothed signal, shape (n,).

        Each piece between two gaps is differentiated separately.
        """
        pieces = np.split(values, self.starts[1:])
        return np.concatenate([np.gradient(piece, self.period) for piece in pieces])

    def sharpened(self, values: Floats) -> Floats:
        """Restore the height of the peaks of a smoothed signal, and return the signal, shape (n,).

        Smoothing makes peaks lower. The parameter `values` is a smoothed signal y. The result is
        2 y - H y = y + (y - H y), where H y is y after a second smoothing. The difference y - H y
        is nearly the height that a peak lost in the first smoothing.
        """
        return 2.0 * values - self.smoothed(values)

    @property
    def f_noise_smoothed(self) -> float:
        """Standard deviation of the noise of the smoothed force [N].

        It is computed from `f_noise`, and is correct if the noise of the measured force is white.
        """
        return self.f_noise * self.noise_gain

    @property
    def noise_gain(self) -> float:
        """Factor by which the smoothing multiplies the standard deviation of white noise."""
        return float(min(1.0, np.sqrt(self.period / (2.0 * np.sqrt(np.pi) * self.width))))

    @property
    def stride(self) -> int:
        """Distance of two samples with nearly independent noise [samples].

        Smoothing correlates the noise of samples that are near each other. The distance is
        therefore a multiple of `width`, and at least 1.
        """
        return max(1, round(2.5 * self.width / self.period))


def smoothed_signals(signals: Signals) -> SmoothedRecord:
    """Interpolate, average and smooth a record.

    The bandwidth of the smoothing is chosen from the coherent band of the record (the frequencies
    at which the force follows the displacement).
    """
    return smoothed_record(resample(signals))


def smoothed_record(resampled: ResampledRecord, bandwidth: float | None = None) -> SmoothedRecord:
    """Average successive samples of a resampled record, and smooth it.

    `bandwidth` is the half-power frequency of the kernel [Hz]; None chooses it from the coherent
    band of the record.
    """
    period, band = resampled.period, resampled.band
    corner = bandwidth or min(SMOOTHING_CORNER * band.high, 0.2 / period)
    width = kernel_width(corner)
    length = max(1, int(width / period / FINENESS))
    step = resampled.step / np.sqrt(12.0 * length)
    grid: list[list[Floats]] = [[] for _ in range(6)]
    starts = [0]
    coarse = period * length
    for piece in resampled.pieces:
        t, x, f = (block_means(channel, length) for channel in piece)
        samples = width / coarse
        columns = (t, x, f, smooth(x, samples), slope(x, samples, coarse), smooth(f, samples))
        for column, values in zip(grid, columns, strict=True):
            column.append(values)
        starts.append(starts[-1] + len(t))
    t, raw_x, raw_f, x, v, f = (np.concatenate(column) for column in grid)
    return SmoothedRecord(
        t,
        raw_x,
        raw_f,
        x,
        v,
        f,
        coarse,
        width,
        band,
        tuple(starts[:-1]),
        x_noise=max(resampled.x_noise / math.sqrt(length), step),
        f_noise=resampled.f_noise / math.sqrt(length),
        count=resampled.count,
        f_count=resampled.f_count,
        f_rounding=repeated_rounding(resampled.f_count, resampled.f_noise),
        ramp=resampled.ramp,
        force_lag=resampled.force_lag,
        filter_delay=resampled.filter_delay,
        compliance=resampled.compliance,
        sampling_period=period,
    )
