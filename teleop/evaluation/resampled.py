"""Interpolate a record onto a grid of constant period, and find its noise and its coherent band.

The coherent band is the band of frequencies in which the force follows the displacement.

The record is smoothed later. The result of this module does not depend on the bandwidth of the
smoothing. A record that is smoothed with several bandwidths is therefore resampled only once.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from estimation.arrays import Floats
from estimation.coherent_band import CoherentBand, coherent_band
from estimation.filters import Lag
from teleop.evaluation.signals import Signals
from teleop.evaluation.single_stroke import combined, stroke_band
from teleop.evaluation.smallest_step import smallest_step

FEWEST = 16
"""Smallest number of samples in a piece between two gaps. Shorter pieces are not used."""


@dataclass(frozen=True)
class Resampled:
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
    (`teleop.evaluation.single_stroke`). False if it is computed from the spectra."""
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


def resample(signals: Signals, force_lag: float = 0.0) -> Resampled:
    """Interpolate a record linearly onto a grid of constant period.

    Gaps, in which samples are missing, divide the record into pieces. Each piece is interpolated
    separately.

    Parameters
    ----------
    signals
        The record.
    force_lag
        Time constant of the first-order lag of the force channel [s]. The lag is compensated by
        filtering the position with the same lag.

    Raises
    ------
    ValueError
        No piece has `FEWEST` samples or more.
    """
    period = float(np.median(signals.dt))
    bounds = sorted({0, len(signals.t), *signals.gaps})
    pieces = []
    for start, end in pairwise(bounds):
        t = signals.t[start:end]
        count = int(np.floor((t[-1] - t[0]) / period + 0.5)) + 1 if len(t) > 1 else 1
        if count < FEWEST:
            continue
        even = t[0] + period * np.arange(count)
        x, f = (np.interp(even, t, channel[start:end]) for channel in (signals.x, signals.f))
        x = Lag(force_lag).run(x, np.full(count, period))
        pieces.append((even, x, f))
    if not pieces:
        raise ValueError(
            f"no piece between gaps has {FEWEST} samples or more: expected longer pieces"
        )
    _, x, f = max(pieces, key=lambda piece: len(piece[0]))
    x_noise, f_noise = measurement_noise(x), measurement_noise(f)
    spectral = coherent_band(x, f, period)
    stroke = stroke_band(x, f, period, x_noise)
    band = combined(spectral, stroke) if stroke else spectral
    return Resampled(
        pieces,
        period,
        band,
        ramp=band is stroke,
        x_noise=x_noise,
        f_noise=f_noise,
        step=smallest_step(x),
        count=smallest_step(signals.x),
        f_count=smallest_step(signals.f),
        force_lag=force_lag,
    )


def measurement_noise(values: Floats) -> float:
    """Estimate the standard deviation of the white noise in a signal, in the unit of the signal.

    It is computed from the third differences of the signal. The differences remove slow motion, but
    not the noise.

    Parameters
    ----------
    values
        Evenly sampled values of the signal, shape (n,).
    """
    return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / np.sqrt(20.0))
