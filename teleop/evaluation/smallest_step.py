"""The smallest step of a channel: one count of an encoder or a converter."""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled import Floats

ROUNDING = 1e-12
"""Steps smaller than this share of the largest value are rounding errors."""


def smallest_step(values: Floats) -> float:
    """Return the smallest change between successive samples; 0 if there is none.

    Parameters
    ----------
    values
        Samples of one channel, shape (n,).
    """
    steps = np.abs(np.diff(values))
    steps = steps[steps > ROUNDING * float(np.max(np.abs(values), initial=0.0))]
    return float(steps.min()) if len(steps) else 0.0


def repeated_rounding(count: float, noise: float) -> float:
    """Return the standard deviation of the rounding error that repeats with the signal.

    Rounding to counts has an error of count / sqrt(12). It is the same whenever the signal has the
    same value, unless noise before the rounding varies it. Noise reduces the mean error at one
    value by the characteristic function of the noise at 2 pi / count (Widrow).

    Parameters
    ----------
    count
        Smallest step of the channel.
    noise
        Standard deviation of the measured noise, in the same unit. It includes the rounding error
        if that changes from sample to sample.

    References
    ----------
    B. Widrow, I. Kollar, "Quantization noise", Cambridge University Press, 2008.
    """
    rounding = count / math.sqrt(12.0)
    if rounding == 0.0:
        return 0.0
    before = max(noise**2 - rounding**2, 0.0) / count**2
    return rounding * math.exp(-min(2.0 * math.pi**2 * before, 700.0))
