"""Compute the resolution of a measured channel (its smallest step), and the rounding error."""

from __future__ import annotations

import math

import numpy as np

from estimation.arrays import Floats
from teleop.evaluation.reading.thresholds import ROUNDING_OF_STEP


def smallest_step(values: Floats) -> float:
    """Return the smallest change of the value between successive samples, without zero changes.

    The result is 0 if the value never changes. For a channel with an encoder or an analogue-digital
    converter, the result is the resolution.
    """
    steps = np.abs(np.diff(values))
    steps = steps[steps > ROUNDING_OF_STEP * float(np.max(np.abs(values), initial=0.0))]
    return float(steps.min()) if len(steps) else 0.0


def repeated_rounding(count: float, noise: float) -> float:
    """Return the standard deviation of the repeatable part of the rounding error of a signal.

    A signal that is rounded to multiples of the resolution `count` has a rounding error with the
    standard deviation count / sqrt(12). Without noise, the error is the same whenever the signal
    has the same value: the error is repeatable. If the signal contains noise before the rounding,
    the error varies randomly. The repeatable part is then the mean error at a given value of the
    signal. The noise reduces the repeatable part by a factor. This factor is the characteristic
    function of the noise at 2 pi / count (Widrow).

    References
    ----------
    B. Widrow, I. Kollar, "Quantization noise", Cambridge University Press, 2008.
    """
    rounding = count / math.sqrt(12.0)
    if rounding == 0.0:
        return 0.0
    before = max(noise**2 - rounding**2, 0.0) / count**2
    return rounding * math.exp(-min(2.0 * math.pi**2 * before, 700.0))
