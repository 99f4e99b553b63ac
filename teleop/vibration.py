"""Threshold of vibrations that a person feels."""

from __future__ import annotations

import math


def detectable(frequency: float) -> float:
    """Return the smallest amplitude of a vibration that the fingers detect, about [m].

    The threshold of the skin of the hand is about 25 um up to 3 Hz. From there it falls by 5 dB per
    octave up to 35 Hz, and then by 12 dB per octave up to 250 Hz (S. J. Bolanowski, G. A.
    Gescheider, R. T. Verrillo, C. M. Checkosky, J. Acoust. Soc. Am. 84(5), 1988, 1680-1694).
    `frequency` is in Hz.
    """
    slow = math.log2(min(max(frequency, 3.0), 35.0) / 3.0)
    fast = math.log2(min(max(frequency, 35.0), 250.0) / 35.0)
    return 25e-6 * math.pow(10.0, -(5.0 * slow + 12.0 * fast) / 20.0)
