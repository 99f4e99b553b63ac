"""The band of frequencies in which a force follows a displacement.

The highest peak in the spectrum of the displacement need not be the palpation: a slow drift of the
position, for example in a raster scan, can be larger. The band is therefore computed from the part
of the force that is coherent with the displacement. Its power spectrum is C(w) S_ff(w), with the
coherence C and the spectrum S_ff of the force.

- The lower end is that of w^2 C S_ff, the power of the force rate, in which a slow baseline is
  small.
- The centre and the upper end are those of w C S_ff. This weight is a compromise: the holds of a
  ramp-and-hold motion dominate C S_ff, and its corners dominate w^2 C S_ff.

C is estimated by Thomson's multitaper method. It does not divide the record, of length T, into
segments; its resolution is 4 / T. A frequency bin is used if two conditions hold: its coherence is
higher than independent signals reach in one of a million bins, and its force exceeds the noise.

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
"""Number of tapers; the time-bandwidth product is (TAPERS + 1) / 2."""
COHERENT = (0.9, 0.5)
"""Least coherence of a bin that is used; the second value if no bin reaches the first.

In a bin, independent signals exceed c with the probability (1 - c)^(TAPERS - 1): 1e-6 and 0.016.
"""
ABOVE_NOISE = 10.0
"""Least power of the force in a bin, relative to the median power in the upper half of the bins."""
MOST_SAMPLES = 1 << 16
"""Largest number of samples; blocks of samples of a longer record are averaged first."""
LOWEST, HIGHEST = 0.005, 0.95
"""Shares of the power below the lower and below the upper end of the band."""


class CoherentBand(NamedTuple):
    """Band of the force that is coherent with the displacement."""

    low: float
    """Frequency below which 0.5 % of the power of the coherent force rate lies [Hz]."""
    centre: float
    """Median frequency of w C S_ff [Hz]."""
    high: float
    """Frequency below which 95 % of w C S_ff lies, minus the half bandwidth of the tapers [Hz]."""
    coherence: float
    """Mean coherence, weighted by the power; 0 if no bin is coherent."""


def block_means(values: Floats, length: int) -> Floats:
    """Return the means of blocks of `length` samples; an incomplete last block is dropped."""
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
