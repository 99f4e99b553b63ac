"""Compute the fraction of the variance of the force that the signal conditioning keeps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats

LONGEST_DELAY = 0.5
"""Longest delay of the conditioning that is tried, as a multiple of 1 / bandwidth."""
DELAYS = 26
"""Number of delays of the conditioning that are tried."""
MOST_SAMPLES = 20_000
"""Approximate number of samples that are compared."""


def kept_variance(
    raw: Floats, conditioned: Floats, used: NDArray[np.intp], bandwidth: float
) -> float:
    """Return the fraction of a signal's variance that conditioning keeps, from 0 to 1.

    The raw signal is delayed like the conditioned signal. The kept part is the conditioned signal.
    The removed part is the difference between the delayed raw signal and the conditioned signal.
    The result is the variance of the kept part, divided by the sum of the variances of both parts.
    The delay is chosen such that the difference is smallest.

    Parameters
    ----------
    raw
        The signal as measured, shape (n,).
    conditioned
        The conditioned signal at the samples that are used, shape (m,).
    used
        Index in `raw` of each sample that is used, shape (m,).
    bandwidth
        Bandwidth of the conditioning [cycles per sample].
    """
    step = max(1, len(used) // MOST_SAMPLES)
    used, kept = used[::step], conditioned[::step]
    delays = np.unique(np.linspace(0.0, LONGEST_DELAY / bandwidth, DELAYS).round().astype(np.intp))
    removed = min(float(np.var(raw[np.maximum(used - d, 0)] - kept)) for d in delays)
    variance = float(np.var(kept))
    return variance / max(variance + removed, 1e-300)
