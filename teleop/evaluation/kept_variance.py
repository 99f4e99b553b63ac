"""Compute the fraction of the variance of the force that remains after the filters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats

LONGEST_DELAY = 0.5
"""Longest delay of the filters that is tried, as a multiple of 1 / bandwidth."""
DELAYS = 26
"""Number of delays of the filters that are tried."""
MOST_SAMPLES = 20_000
"""Approximate largest number of samples of which the variance is computed."""


def kept_variance(
    raw: Floats, conditioned: Floats, used: NDArray[np.intp], bandwidth: float
) -> float:
    """Return the fraction of the variance of a signal that filters keep, from 0 to 1.

    Let y be the filtered signal, and r(d) the measured signal with a delay of d samples. The
    filters remove r(d) - y from the signal. The result is

        var(y) / (var(y) + var(r(d) - y)).

    The filters delay the signal by an unknown number of samples. Therefore, several delays d are
    tried, and the delay for which var(r(d) - y) is smallest is used.

    Parameters
    ----------
    raw
        The measured signal, shape (n,).
    conditioned
        The filtered signal y at the samples that the estimators receive, shape (m,).
    used
        Index in `raw` of each sample of `conditioned`, shape (m,).
    bandwidth
        Bandwidth of the filters [cycles per sample].
    """
    step = max(1, len(used) // MOST_SAMPLES)
    used, kept = used[::step], conditioned[::step]
    delays = np.unique(np.linspace(0.0, LONGEST_DELAY / bandwidth, DELAYS).round().astype(np.intp))
    removed = min(float(np.var(raw[np.maximum(used - d, 0)] - kept)) for d in delays)
    variance = float(np.var(kept))
    return variance / max(variance + removed, 1e-300)
