"""Prepare a record for batch evaluation: resample it evenly, and smooth it without delay.

1. The record is interpolated linearly onto a grid of constant period
   (`teleop.evaluation.resampled`).
2. If the sampling rate is much higher than necessary for the bandwidth of the force, successive
   samples are averaged in blocks.
3. Position and force are smoothed with the same Gaussian kernel (`estimation.smoothing`).
   Therefore, a model that is linear in its parameters also holds for the smoothed signals.

The corner frequency of the kernel is a multiple of the upper end of the coherent band. In this
band, the force follows the displacement (`estimation.coherent_band`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import median_filter

from estimation.baseline import FEWEST_CYCLES, baseline_order, without_baseline
from estimation.coherent_band import CoherentBand, block_means
from estimation.compiled import Floats
from estimation.smoothing import kernel_width, slope, smooth, smooth_pieces
from teleop.evaluation.resampled import Resampled, resample
from teleop.evaluation.signals import Signals
from teleop.evaluation.smallest_step import repeated_rounding
from teleop.evaluation.turning_points import cycle_frequency, turning_points

CORNER = 5.0
"""Corner frequency of the kernel, as a multiple of the upper end of the coherent band."""
FINENESS = 4.0
"""Smallest number of grid points per standard deviation of the kernel, if the sampling rate of the
record is high enough."""
SINE = 0.9
"""Fundamental share (see `Prepared.fundamental_share`) above which a motion counts as a sine. The
share is 1 for a sine and 0.84 for a triangle wave."""
OUTLIERS = 5
"""Length of the median filter that removes outliers before the fundamental share is computed
[samples]."""


@dataclass(frozen=True)
class Prepared:
    """A record on a grid of constant period. Arrays have shape (n,)."""

    t: Floats
    """Time [s]."""
    raw_x: Floats
    """Measured position, delayed by the force lag and averaged over a grid period [m]."""
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
    """Standard deviation of the part of the force's rounding error that is the same whenever the
    force has the same value [N]."""
    ramp: bool
    """Whether only the trend of position and force shows that the force follows the position."""
    force_lag: float
    """Time constant of the force channel that is compensated [s]."""

    @cached_property
    def clock(self) -> Floats:
        """Time since the first sample, without the duration of gaps [s], shape (n,)."""
        return np.asarray(self.period * np.arange(len(self.t)), dtype=np.float64)

    @cached_property
    def force_range(self) -> tuple[float, float]:
        """Percentiles 0.5 and 99.5 of the smoothed force [N]: its range without outliers."""
        low, high = (float(v) for v in np.percentile(self.f, [0.5, 99.5]))
        return low, high

    @cached_property
    def order(self) -> int:
        """Number of cosines in the baseline. The cosines are slower than the palpation.

        The number is 0 if the motion has fewer than three cycles.
        """
        order = baseline_order(self.band.low, float(self.clock[-1]))
        if order == 0 or self.band.coherence == 0.0:
            return 0
        fast = float(np.std(without_baseline(self.x, order)))
        turns = turning_points(self.x, fast)
        return order if len(turns) - 2 >= 2 * FEWEST_CYCLES else 0

    @cached_property
    def fundamental_share(self) -> float:
        """Share of the fundamental in the motion; NaN for a motion of less than three cycles.

        The fundamental is the frequency at which the spectrum of the velocity has its maximum. The
        share is the power of the velocity between 0.5 and 1.5 times this frequency, divided by its
        power up to 10 times this frequency. A triangle wave, holds and tremor of the hand reduce
        it. A small oscillation of the drive within the lost motion hardly changes it. Single
        outliers of the position are removed first.
        """
        x = median_filter(self.raw_x, OUTLIERS, mode="nearest")
        x = without_baseline(x, self.order)
        if len(turning_points(x, float(np.std(x)))) - 2 < 2 * FEWEST_CYCLES - 1:
            return math.nan
        pieces = np.split(x, self.starts[1:])
        v = np.concatenate([np.gradient(piece, self.period) for piece in pieces])
        power = np.abs(np.fft.rfft((v - v.mean()) * np.hanning(len(v)))[1:]) ** 2
        ratio = np.arange(1, len(power) + 1) / (1 + np.argmax(power))
        return float(power[(ratio > 0.5) & (ratio < 1.5)].sum() / power[ratio < 10.0].sum())

    @property
    def sinusoidal(self) -> bool:
        """Whether the motion counts as a sine: a fundamental share above `SINE`."""
        return self.fundamental_share > SINE

    @cached_property
    def frequency(self) -> float:
        """Frequency of the palpation [Hz]; NaN for a motion without cycles."""
        if self.order == 0 and not self.sinusoidal:
            return float("nan")
        return cycle_frequency(self.palpation, self.period) or self.band.centre

    @cached_property
    def palpation(self) -> Floats:
        """Smoothed position minus its baseline [m], shape (n,)."""
        return without_baseline(self.x, self.order)

    def smoothed(self, values: Floats) -> Floats:
        """Smooth values on the grid with the kernel, and return them, shape (n,)."""
        return smooth_pieces(values, self.starts, self.width / self.period)

    def sharpened(self, values: Floats) -> Floats:
        """Return values whose peaks are nearly as high as before the smoothing.

        The parameter `values` contains smoothed values y. The result is 2 y - H y, where H y are
        the values y after a second smoothing.
        """
        return 2.0 * values - self.smoothed(values)

    @property
    def f_noise_smoothed(self) -> float:
        """Standard deviation of the noise of the smoothed force [N], if measured noise is white."""
        return self.f_noise * self.noise_gain

    @property
    def noise_gain(self) -> float:
        """Factor by which the smoothing multiplies the standard deviation of white noise."""
        return float(min(1.0, np.sqrt(self.period / (2.0 * np.sqrt(np.pi) * self.width))))

    @property
    def stride(self) -> int:
        """Distance of two samples whose noise is nearly independent after smoothing [samples].

        It is 2.5 kernel widths.
        """
        return max(1, round(2.5 * self.width / self.period))


def prepare(signals: Signals) -> Prepared:
    """Interpolate, average and smooth a record, with the bandwidth of its coherent band.

    Raises
    ------
    ValueError
        No piece between gaps is long enough.
    """
    return smoothed_record(resample(signals))


def smoothed_record(resampled: Resampled, bandwidth: float | None = None) -> Prepared:
    """Average and smooth a record on an even grid.

    Parameters
    ----------
    resampled
        The record.
    bandwidth
        Half-power frequency of the kernel [Hz]; None to choose it from the coherent band.
    """
    period, band = resampled.period, resampled.band
    corner = bandwidth or min(CORNER * band.high, 0.2 / period)
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
    return Prepared(
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
    )
