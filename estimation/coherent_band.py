"""Find the band of frequencies in which the force is coherent with the displacement.

The highest peak in the spectrum of the displacement is not always at the frequency of the
palpation. A slow drift of the position, for example in a raster scan, can have a higher peak. The
band is therefore computed from the part of the force that is coherent with the displacement. The
power spectrum of this part is C(w) S_ff(w), where w is the angular frequency, C is the coherence,
and S_ff is the power spectrum of the force.

- The lower end of the band is computed from w^2 C S_ff. This is the power spectrum of the time
  derivative of the coherent force. In this derivative, a slow drift of the force is small.
- The centre and the upper end are computed from w C S_ff. The factor w is a compromise between 1
  and w^2. In a motion of ramps and holds, C S_ff is mainly due to the holds, and w^2 C S_ff is
  mainly due to the corners between ramps and holds.

C is estimated by Thomson's multitaper method. This method does not divide the record into segments.
For a record of length T, the estimate at a frequency is a mean over the frequencies that differ
from it by less than 4 / T. A frequency bin is used if it satisfies two conditions. First, the power
of the force in the bin is well above the noise (`ABOVE_NOISE`). Second, the estimated coherence in
the bin is above a limit (`COHERENT`). If force and displacement were independent signals, their
estimated coherence would exceed this limit in only one of a million bins. If no bin satisfies both
conditions, a lower limit is used.

References
----------
D. J. Thomson, "Spectrum estimation and harmonic analysis", Proc. IEEE 70(9), 1982.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh_tridiagonal

from estimation.arrays import Floats

TAPERS = 6
"""Number of tapers.

There are 2 NW orthogonal tapers (`BANDWIDTH` is NW). The last two of them are not used, because
their spectral leakage is large. Even with one taper more, the ends of a single slow stroke would
appear as power at all frequencies.
"""
BANDWIDTH = 4.0
"""Time-bandwidth product NW of the tapers."""
COHERENT = (0.94, 0.56)
"""Two limits of the coherence. A bin is used if its coherence is at least the first limit.

If this condition selects no bin, the second limit is used instead of the first.

In a bin, the estimated coherence of independent signals is larger than c with the probability
(1 - c)^(TAPERS - 1). This probability is 1e-6 for the first limit and 0.016 for the second.
"""
ABOVE_NOISE = 10.0
"""A bin is used if the power of the force in the bin is above this multiple of the noise power.

The noise power is the median power of the upper half of the bins.
"""
MOST_SAMPLES = 1 << 16
"""A record with at least twice this number of samples is first averaged in blocks."""
LOWEST, HIGHEST = 0.005, 0.95
"""Fractions of the weighted power that define the band: the fraction below the lower end of the
band, and the fraction below its upper end. The weights are w^2 and w."""


class CoherentBand(NamedTuple):
    """Frequency band in which the force is coherent with the displacement.

    w is the angular frequency, C is the coherence, and S_ff is the power spectrum of the force. If
    the force is not coherent with the displacement at any frequency, `coherence` is 0, and the band
    is not meaningful.
    """

    low: float
    """Frequency below which 0.5 % of the integral of w^2 C S_ff lies [Hz]."""
    centre: float
    """Frequency that divides the integral of w C S_ff into two equal parts [Hz]."""
    high: float
    """Frequency below which 95 % of the integral of w C S_ff lies [Hz].

    The half bandwidth of the tapers is subtracted from this frequency.
    """
    coherence: float
    """Mean of C with the weights C S_ff; 0 if the force is not coherent at any frequency."""


def block_means(values: Floats, length: int) -> Floats:
    """Return the mean of each block of `length` samples. An incomplete last block is discarded."""
    if length == 1:
        return values
    whole = len(values) // length
    return np.asarray(values[: whole * length].reshape(whole, length).mean(axis=1))


@lru_cache(maxsize=2)  # files of one length are often evaluated one after the other
def slepian_tapers(n: int) -> Floats:
    """Return the tapers of the multitaper method, a read-only array of shape (TAPERS, n).

    The tapers are the first discrete prolate spheroidal sequences. Each row is one sequence, and
    the rows are orthonormal. The sequences are eigenvectors of a tridiagonal matrix (D. Slepian,
    Bell System Technical Journal 57(5), 1978). The sign of each sequence is arbitrary.
    """
    place = np.arange(n, dtype=np.float64)
    half_band = BANDWIDTH / n
    diagonal = ((n - 1 - 2 * place) / 2.0) ** 2 * np.cos(2.0 * np.pi * half_band)
    beside = place[1:] * (n - place[1:]) / 2.0
    _, vectors = eigh_tridiagonal(diagonal, beside, select="i", select_range=(n - TAPERS, n - 1))
    tapers = np.ascontiguousarray(vectors[:, ::-1].T)
    tapers.flags.writeable = False
    return tapers


def coherent_band(x: Floats, f: Floats, period: float) -> CoherentBand:
    """Return the frequency band in which the force is coherent with the displacement.

    x [m] and f [N] have a constant sample period [s]. ValueError if there are fewer than 16
    samples.
    """
    if len(x) < 16:
        raise ValueError(f"16 samples are needed for a spectrum, got {len(x)}")
    length = max(1, len(x) // MOST_SAMPLES)
    x, f = block_means(x, length), block_means(f, length)
    period *= length
    n = len(x)
    tapers = slepian_tapers(n)
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
    leakage = BANDWIDTH / (n * period)
    return CoherentBand(
        low=float(frequency[np.searchsorted(rate, LOWEST * rate[-1])]),
        centre=centre,
        high=max(centre, high - leakage),
        coherence=float(counted @ coherence / counted.sum()),
    )
