"""Compute the smallest step of a measured channel: one count of an encoder or a converter."""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled import Floats

ROUNDING = 1e-12
"""Steps smaller than this fraction of the largest value are treated as rounding errors."""


def smallest_step(values: Floats) -> float:
    """Return the smallest change between successive samples; 0 if the value never changes.

    Parameters
    ----------
    values
        Samples of one channel, shape (n,).
    """
    steps = np.abs(np.diff(values))
    steps = steps[steps > ROUNDING * float(np.max(np.abs(values), initial=0.0))]
    return float(steps.min()) if len(steps) else 0.0


def repeated_rounding(count: float, noise: float) -> float:
    """Return the standard deviation of the repeatable part of the rounding error of a signal.

    Rounding to counts causes an error with standard deviation count / sqrt(12). Without noise, the
    error is the same whenever the signal has the same value: the error is repeatable. If noise is
    added to the signal before the rounding, the error varies randomly, and its mean at a given
    value is smaller. This mean is the repeatable part. The noise reduces it by a factor that is the
    characteristic function of the noise at 2 pi / count (Widrow).

    Parameters
    ----------
    count
        Smallest step of the channel.
    noise
        Standard deviation of the measured noise, in the unit of `count`. It includes the rounding
        error if the rounding error changes from sample to sample.

    References
    ----------
    B. Widrow, I. Kollar, "Quantization noise", Cambridge University Press, 2008.
    """
    rounding = count / math.sqrt(12.0)
    if rounding == 0.0:
        return 0.0
    before = max(noise**2 - rounding**2, 0.0) / count**2
    return rounding * math.exp(-min(2.0 * math.pi**2 * before, 700.0))
