"""How persistently exciting the motion is."""

from __future__ import annotations

import math
from collections import deque

OMEGA = 2.0 * math.pi
"""Angular frequency [rad/s] by which velocity compares with displacement, a palpation a second."""


class Excitation:
    """How far the regressors of a sliding window are from rank-deficient, 0 to 1.

    The regressors [v / OMEGA, x], both in metres, have a mean Gram matrix over the window,
    an ellipse whose roundness persistent excitation is. The measure is the ratio of its
    eigenvalues, smallest to largest: 1 for a sine of 1 Hz about zero, 0 for a hold, where
    only stiffness shows, and 0 where displacement and velocity are proportional.

    Parameters
    ----------
    window
        Length of the sliding window [s].
    resolution
        Displacement [m] below which motion is measurement noise: its square is added to the
        largest eigenvalue, so that noise alone does not count as excitation.

    Raises
    ------
    ValueError
        A parameter is not positive.
    """

    def __init__(self, window: float = 1.0, resolution: float = 1e-5) -> None:
        if not (0.0 < window < math.inf and 0.0 < resolution < math.inf):
            raise ValueError(
                f"window and resolution must be positive, got {window} s and {resolution} m"
            )
        self.window = window
        self.resolution = resolution
        self._samples: deque[tuple[float, float, float, float]] = deque()
        self._xx = self._xy = self._yy = self._span = 0.0

    def update(self, x: float, v: float, dt: float) -> float:
        """Take in displacement [m] and velocity [m/s] of a sample `dt` [s] after the last."""
        y = v / OMEGA
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
