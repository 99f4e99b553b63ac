"""Compute the dominant frequency of a motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def dominant_frequency(x: ArrayLike, dt: ArrayLike) -> float:
    """Return the frequency [Hz] of the largest peak in the spectrum of a motion.

    The mean and a linear drift of the displacement are subtracted first.

    x [m] has the shape (n,), and `dt` [s] too or is one number. ValueError if there are fewer than
    four samples, or the displacement is constant.
    """
    x = np.asarray(x, dtype=np.float64)
    if x.ndim != 1 or len(x) < 4 or not np.ptp(x) > 0.0:
        raise ValueError(f"a motion of at least four samples is needed, got shape {x.shape}")
    t = np.cumsum(np.broadcast_to(np.asarray(dt, dtype=np.float64), x.shape))
    even = np.linspace(t[0], t[-1], len(t))
    motion = np.interp(even, t, x)
    seconds = even - even.mean()
    drift = (seconds @ motion) / (seconds @ seconds) * seconds
    spectrum = np.abs(np.fft.rfft(motion - motion.mean() - drift))
    return (int(np.argmax(spectrum[1:])) + 1) / float(t[-1] - t[0])
