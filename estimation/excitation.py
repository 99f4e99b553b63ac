"""Compute a measure of the persistent excitation, and the dominant frequency of a motion."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from estimation.arrays import Floats
from estimation.checks import checked_samples, is_valid, sample_error
from estimation.compiled import looped

LEAST_EXCITATION = 0.01
"""If the excitation is below this limit, the program reports that k and b cannot be separated.

Below this excitation, the standard deviation of b omega is more than ten times that of k. If k is
known to 10 %, a loss tangent b omega / k below one can then not be measured.
"""


class Excitation:
    """Measure of persistent excitation over a sliding window, from 0 to 1.

    Let phi = [v / omega, x], with the angular frequency omega = 2 pi `frequency`. Both elements are
    in metres. The measure is the ratio of the smallest to the largest eigenvalue of the matrix
    phi phi', averaged over the window. The measure is near

    - 1 for a sinusoidal displacement with the mean 0 and the given frequency;
    - 0 while the position is constant, because only the stiffness can then be identified;
    - 0 while velocity and displacement are proportional to each other.

    Parameters
    ----------
    frequency
        Expected frequency of the motion [Hz]. Default: one palpation per second.
    window
        Length of the sliding window [s]. Default: one period of `frequency`.
    resolution
        A motion with an amplitude below this displacement [m] is taken as measurement noise. The
        square of this displacement is added to the largest eigenvalue, so that noise alone gives a
        measure near 0.

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
        """Process one sample: x [m], v [m/s], and the time `dt` [s] since the previous sample.

        Returns
        -------
        Measure of persistent excitation over the present window, from 0 to 1.

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

    def run(self, x: ArrayLike, v: ArrayLike, dt: ArrayLike) -> Floats:
        """Process n samples, with the same results as n calls of `update`.

        Parameters
        ----------
        x, v, dt
            Displacement [m], velocity [m/s] and time since the previous sample [s], each of shape
            (n,).

        Returns
        -------
        Measure of persistent excitation after each sample, from 0 to 1, shape (n,).

        Raises
        ------
        ValueError
            The shapes differ, a value is not finite or too large, or a `dt` is not positive.
        """
        samples = checked_samples(x, v, x, dt)
        count = len(samples.dt)
        x, y, dt = samples.phi[:, 1], samples.phi[:, 0] / self._omega, samples.dt
        new = np.stack([x * x * dt, x * y * dt, y * y * dt, dt])
        stored = np.reshape(self._samples, (-1, 4)).T
        window = np.concatenate([stored, new], axis=1)
        removed, spans = np.zeros(count, dtype=np.intp), np.empty(count)
        constants = (self.window, self._span, stored.shape[1])
        looped(removals, constants, (window[3].copy(),), (removed, spans))
        # Each sum is a cumulative sum over the samples that are added and removed, in the same
        # order as in `update`. So the sums are identical to those of `update` to the bit.
        added = np.arange(1, count + 1) + np.concatenate(([0], removed[:-1]))
        after = np.arange(1, count + 1) + removed
        sums = np.empty((3, count))
        for i, start in enumerate((self._xx, self._xy, self._yy)):
            terms = np.empty(1 + count + int(removed[-1]) if count else 1)
            terms[0] = start
            is_removal = np.ones(len(terms), dtype=np.bool_)
            is_removal[0] = False
            is_removal[added] = False
            terms[added] = new[i]
            terms[is_removal] = -window[i, : len(terms) - 1 - count]
            sums[i] = np.cumsum(terms)[after]
        if not count:
            return np.empty(0)
        xx, xy, yy = sums
        self._samples = deque(zip(*window[:, removed[-1] :].tolist(), strict=True))
        self._xx, self._xy, self._yy = (float(total[-1]) for total in sums)
        self._span = float(spans[-1])
        mean = 0.5 * (xx + yy) / spans
        root = list(map(math.hypot, (0.5 * (xx - yy)).tolist(), xy.tolist()))
        half = np.array(root) / spans
        return np.asarray(np.maximum(0.0, mean - half) / (mean + half + self.resolution**2))


def removals(
    window: float,
    span: float,
    stored: int,
    periods: Sequence[float],
    removed: list[int],
    spans: list[float],
) -> None:
    """Add n new samples to a sliding window, and remove old samples that are outside the window.

    The results are written to `removed` and `spans`.

    `span` is the length of the window [s] and `stored` its number of samples before the first new
    sample. `periods` contains the times since the previous sample [s] of the stored and then of the
    new samples. `removed` gets the total number of removed samples, and `spans` the length of the
    window [s], after each new sample.
    """
    first = 0
    for i in range(len(removed)):
        span += periods[stored + i]
        while span > window and first < stored + i:
            span -= periods[first]
            first += 1
        removed[i] = first
        spans[i] = span


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
