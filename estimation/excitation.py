"""Persistent excitation and dominant frequency of a motion."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import ArrayLike

from estimation.checks import is_valid, sample_error


class Excitation:
    """Measure of persistent excitation over a sliding window, from 0 to 1.

    The measure is the ratio of the smallest to the largest eigenvalue of the mean Gram matrix of
    the regressors [v / omega, x], both in metres. It is 1 for a sinusoidal displacement of the
    given frequency with mean 0. It is 0 in a hold, where only the stiffness can be identified, and
    0 if displacement and velocity are proportional throughout the window.

    Parameters
    ----------
    frequency
        Frequency omega / 2 pi [Hz]; omega scales velocity to displacement. The default is one
        palpation per second.
    window
        Length of the sliding window [s]; one period by default.
    resolution
        Displacement [m] below which motion is measurement noise. Its square is added to the
        largest eigenvalue, so that noise alone gives a measure near 0.

    Raises
    ------
    ValueError
        A parameter is not positive.
    """

    def __init__(
        self, frequency: float = 1.0, window: float | None = None, resolution: float = 1e-5
    ) -> None:
        if window is None:
            window = 1.0 / frequency if frequency else math.inf
        for name, value in (
            ("frequency", frequency),
            ("window", window),
            ("resolution", resolution),
        ):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        self.window = window
        self.resolution = resolution
        self._omega = 2.0 * math.pi * frequency
        self._samples: deque[tuple[float, float, float, float]] = deque()
        self._xx = self._xy = self._yy = self._span = 0.0

    def update(self, x: float, v: float, dt: float) -> float:
        """Process displacement [m] and velocity [m/s] `dt` [s] after the previous sample.

        Returns
        -------
        The measure over the latest window, from 0 to 1.

        Raises
        ------
        ValueError
            A value is not finite or too large, or `dt` is not positive.
        """
        if not is_valid(dt, abs(x) + abs(v)):
            raise sample_error(dt, x=x, v=v)
        y = v / self._omega
        sample = (x * x * dt, x * y * dt, y * y * dt, dt)
        self._samples.append(sample)
        self._xx += sample[0]
        self._xy += sample[1]
        self._yy += sample[2]
        self._span += dt
        while self._span > self.window and len(self._samples) > 1:
            xx, xy, yy, span = self._samples.popleft()
            self._xx -= xx
            self._xy -= xy
            self._yy -= yy
            self._span -= span
        mean = 0.5 * (self._xx + self._yy) / self._span
        half = math.hypot(0.5 * (self._xx - self._yy), self._xy) / self._span
        return max(0.0, mean - half) / (mean + half + self.resolution**2)


def dominant_frequency(x: ArrayLike, dt: ArrayLike) -> float:
    """Return the frequency [Hz] of the largest peak in the spectrum of a motion.

    A linear drift is subtracted first.

    Parameters
    ----------
    x
        Displacement [m], shape (n,).
    dt
        Time since the previous sample [s], shape (n,), or one number for all.

    Raises
    ------
    ValueError
        There are fewer than four samples, or the displacement is constant.
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
