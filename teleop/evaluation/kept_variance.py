"""The share of the variance of the force that the conditioning keeps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats

LONGEST_DELAY = 0.5
"""Longest delay of the conditioning that is tried, relative to 1 / bandwidth."""
DELAYS = 26
"""Number of delays tried."""
MOST_SAMPLES = 20_000
"""Approximate number of samples that are compared."""


def kept_variance(
    raw: Floats, conditioned: Floats, used: NDArray[np.intp], bandwidth: float
) -> float:
    """Return the share of the variance of a signal that conditioning keeps, from 0 to 1.

    The signal is the sum of a kept and a removed part: the conditioned signal, and the difference
    between it and the signal with the same delay. The result is the variance of the kept part
    relative to the sum of the two variances. The delay is that with the smallest difference.

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
