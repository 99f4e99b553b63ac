"""Baselines: what of a signal is slower than the palpation.

A baseline is a sum of the cosines cos(pi j (t - t0) / T), j = 0 ... m, of at most the frequency
m / (2 T). Regressors that hold these cosines take a slow drift of force and position out of a
fit (Frisch and Waugh) at the cost of the slow part of the information.

References
----------
R. Frisch, F. V. Waugh, "Partial time regressions as compared with individual trends",
Econometrica 1(4), 1933.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled import Floats

BELOW = 0.6
"""A baseline reaches to this share of the lower end of the band of the motion."""
MOST = 300
"""Most cosines: the baseline of a longer record reaches less far up."""
FEWEST_CYCLES = 3.0
"""Fewest cycles of the lower end of the band in a record whose baseline is removed."""


def baseline_order(low: float, seconds: float) -> int:
    """Return the number of cosines besides the constant; 0 where the record is one slow motion.

    Parameters
    ----------
    low
        Lower end of the band in which the force follows the displacement [Hz].
    seconds
        Length of the record [s].
    """
    if low * seconds < FEWEST_CYCLES:
        return 0
    return min(math.floor(2.0 * BELOW * low * seconds), MOST)


def cosines(t: Floats, start: float, seconds: float, order: int) -> Floats:
    """Return the constant and the cosines at these times, shape (n, 1 + order)."""
    return np.asarray(np.cos(np.pi / seconds * np.outer(t - start, np.arange(order + 1))))


def without_baseline(values: Floats, t: Floats, order: int) -> Floats:
    """Return the values less the baseline that fits them best, shape (n,)."""
    if order == 0:
        return values
    basis = cosines(t, float(t[0]), float(t[-1] - t[0]), order)
    return np.asarray(values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0])
