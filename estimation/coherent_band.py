"""The band of frequencies in which a force follows a displacement.

The highest peak of the displacement's spectrum is not the motion that a force answers: a slow
drift of the position, as of a raster scan, can be larger than the palpation. The spectrum here is
that of the force which is coherent with the displacement, C(w) S_ff(w). Its lower end is that of
the force rate, w^2 C S_ff, to which a slow baseline contributes little; its centre and its upper
end are those of w C S_ff, between the power of the force, which the hold of a ramp and hold
dominates, and that of its rate, which its corners dominate. C is the coherence by Thomson's
multitaper method, which needs no division of the record into segments, so that it resolves 4 / T.
A bin counts where its coherence exceeds what independent signals reach once in a million bins, and
where the force exceeds its noise.

References
----------
D. J. Thomson, "Spectrum estimation and harmonic analysis", Proc. IEEE 70(9), 1982.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal.windows import dpss

from estimation.compiled import Floats

TAPERS = 7
"""Tapers of the coherence; the time-bandwidth product is (TAPERS + 1) / 2."""
COHERENT = (0.9, 0.5)
"""Coherence from which on a bin counts; the second where no bin reaches the first.

Independent signals exceed c with probability (1 - c)^(TAPERS - 1) in a bin: 1e-6 and 0.016.
"""
ABOVE_NOISE = 10.0
"""A bin counts where the force has this many times the median power of the upper half."""
MOST_SAMPLES = 1 << 16
"""Longer records are averaged in blocks first."""
LOWEST, HIGHEST = 0.005, 0.95
"""Shares of the power below the lower and the upper end."""


class CoherentBand(NamedTuple):
    """Where the force that follows the displacement has its power."""

    low: float
    """Frequency below which 0.5 % of the power of its rate lies [Hz]."""
    centre: float
    """Median frequency of w C S_ff [Hz]."""
    high: float
    """Frequency below which 95 % of w C S_ff lies, less the width of the tapers [Hz]."""
    coherence: float
    """Mean coherence, weighted with the power; 0 where nothing is coherent."""


def block_means(values: Floats, length: int) -> Floats:
    """Return the means of blocks of this many samples; a rest that fills no block is dropped."""
    if length == 1:
        return values
    whole = len(values) // length
    return np.asarray(values[: whole * length].reshape(whole, length).mean(axis=1))


def coherent_band(x: Floats, f: Floats, period: float) -> CoherentBand:
    """Return the band in which the force follows the displacement.

    Parameters
    ----------
    x, f
        Displacement [m] and force [N], each of shape (n,), evenly sampled.
    period
        Sample period [s].

    Raises
    ------
    ValueError
        There are fewer than 16 samples.
    """
    if len(x) < 16:
        raise ValueError(f"16 samples are needed for a spectrum, got {len(x)}")
    length = max(1, len(x) // MOST_SAMPLES)
    x, f = block_means(x, length), block_means(f, length)
    period *= length
    n = len(x)
    tapers = dpss(n, 0.5 * (TAPERS + 1), TAPERS)
    time = np.linspace(-1.0, 1.0, n)
    line = np.column_stack([np.ones(n), time])
    spectra = []
    for signal in (x, f):
        rest = signal - line @ np.linalg.lstsq(line, signal, rcond=None)[0]
        spectra.append(np.fft.rfft(tapers * rest, axis=1))
    sx, sf = spectra
    cross = np.abs(np.mean(sx * np.conj(sf), axis=0)) ** 2
    sxx, sff = (np.mean(np.abs(s) ** 2, axis=0) for s in (sx, sf))
    coherence = cross / np.maximum(sxx * sff, 1e-300)
    frequency = np.fft.rfftfreq(n, period)
    power = coherence * sff
    power[0] = 0.0
    floor = ABOVE_NOISE * float(np.median(sff[len(sff) // 2 :]))
    for least in COHERENT:
        counted = np.where((coherence >= least) & (sff > floor), power, 0.0)
        if counted.any():
            break
    if not counted.any():
        nyquist = 0.5 / period
        return CoherentBand(1.0 / (n * period), 0.1 * nyquist, nyquist, 0.0)
    rate = np.cumsum(counted * frequency**2)
    between = np.cumsum(counted * frequency)
    centre, high = (
        float(frequency[np.searchsorted(between, share * between[-1])]) for share in (0.5, HIGHEST)
    )
    leakage = 0.5 * (TAPERS + 1) / (n * period)
    return CoherentBand(
        low=float(frequency[np.searchsorted(rate, LOWEST * rate[-1])]),
        centre=centre,
        high=max(centre, high - leakage),
        coherence=float(counted @ coherence / counted.sum()),
    )
