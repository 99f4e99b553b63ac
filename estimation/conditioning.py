"""Signal conditioning: from a measured position and force to the regressors x, v and to f."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.checks import check_sample, checked_samples
from estimation.compiled import Floats
from estimation.filters import Lag, LowPass, angular
from estimation.model import KELVIN_VOIGT, Model

BANDWIDTH = 20.0
"""Default bandwidth of a filter of position and force [Hz].

A palpation by hand has its motion below 2 Hz, so that this passes ten times its frequency, as
`identify` does for any motion. The noise that is left falls with the bandwidth;
`python benchmarks/conditioning.py` compares 10, 20 and 50 Hz.
"""
SETTLED_FIRST, SETTLED_SECOND = 4.605, 6.638
"""Time constants until 1 % is left of a transient, of first order and critically damped."""


class Conditioned(NamedTuple):
    """One sample as estimators take it."""

    x: float
    """Displacement [m]."""
    v: float
    """Velocity [m/s]."""
    f: float
    """Force [N]."""
    further: tuple[float, ...] = ()
    """The model's regressors besides v and x."""


class Regression(NamedTuple):
    """Samples as `Bank.run` takes them, arrays of shape (n,)."""

    x: Floats
    """Displacement [m]."""
    v: Floats
    """Velocity [m/s]."""
    f: Floats
    """Force [N]."""
    dt: Floats
    """Time since the sample before [s]."""
    further: Floats
    """The model's regressors besides v and x, shape (n, regressors - 2)."""

    def part(self, samples: slice | NDArray[np.intp]) -> Regression:
        """Some of the samples."""
        return Regression(*(channel[samples] for channel in self))


class Conditioner(ABC):
    """Turns samples of position and force into the regressors x, v and the force f."""

    settling = 0.0
    """Time after the first sample until 1 % of the transient is left [s]."""

    @abstractmethod
    def reset(self) -> None:
        """Forget every sample."""

    def update(self, x: float, f: float, dt: float) -> Conditioned:
        """Take in position [m] and force [N] of a sample `dt` [s] after the last.

        Raises
        ------
        ValueError
            A value is not finite or absurdly large, or `dt` is not positive. The conditioner
            stays as it was.
        """
        check_sample(dt, x=x, f=f)
        return self._condition(x, f, dt)

    @abstractmethod
    def _condition(self, x: float, f: float, dt: float) -> Conditioned:
        """What `update` gives for a sample that has been checked."""

    def correlation(self, dt: float) -> float:
        """Samples, `dt` [s] apart, for each one whose noise of the force is independent."""
        return 1.0

    def run(self, x: ArrayLike, f: ArrayLike, dt: ArrayLike) -> Regression:
        """Take in n samples as `update` would.

        Raises
        ------
        ValueError
            The shapes differ, a value is not finite, or a `dt` is not positive.
        """
        samples = checked_samples(x, x, f, dt)
        position = samples.phi[:, 1].tolist()
        rows = zip(position, samples.f.tolist(), samples.dt.tolist(), strict=True)
        out = np.array(
            [(c.x, c.v, c.f, *c.further) for c in (self._condition(*row) for row in rows)]
        ).reshape(len(position), -1 if position else 3)
        columns = out.T.copy()
        return Regression(columns[0], columns[1], columns[2], samples.dt, out[:, 3:].copy())


class FilteredDifference(Conditioner):
    """Velocity as the difference quotient of position behind a first-order low-pass.

    Parameters
    ----------
    bandwidth
        Corner frequency [Hz].
    """

    def __init__(self, bandwidth: float) -> None:
        self._omega = angular(bandwidth)
        self.settling = SETTLED_FIRST / self._omega
        self.reset()

    def reset(self) -> None:
        """Forget every sample."""
        self._x = math.nan
        self._v = 0.0

    def _condition(self, x: float, f: float, dt: float) -> Conditioned:
        if not math.isnan(self._x):
            self._v -= math.expm1(-self._omega * dt) * ((x - self._x) / dt - self._v)
        self._x = x
        return Conditioned(x, self._v, f)


class FirstOrderAdaptiveWindowing(Conditioner):
    """Velocity by first-order adaptive windowing (FOAW), end-fit.

    The slope from the oldest to the newest position of the longest window whose positions
    all lie within `resolution` of that line: long and quiet at rest, short and prompt in
    motion.

    Parameters
    ----------
    resolution
        Peak error of a position sample [m], such as the encoder's count.
    longest
        Longest window [samples].

    References
    ----------
    F. Janabi-Sharifi, V. Hayward, C.-S. J. Chen, "Discrete-time adaptive windowing for
    velocity estimation", IEEE Trans. Control Syst. Technol. 8(6), 2000.
    """

    def __init__(self, resolution: float, longest: int = 32) -> None:
        if not 0.0 < resolution < math.inf:
            raise ValueError(f"resolution must be positive, got {resolution} m")
        if longest < 1:
            raise ValueError(f"the longest window must be at least one sample, got {longest}")
        self._resolution = resolution
        self._past: deque[tuple[float, float]] = deque(maxlen=longest)
        self.reset()

    def reset(self) -> None:
        """Forget every sample."""
        self._past.clear()
        self._time = 0.0

    def _condition(self, x: float, f: float, dt: float) -> Conditioned:
        self._time += dt
        v = 0.0
        low, high = -math.inf, math.inf
        for time, position in reversed(self._past):
            span = self._time - time
            slope = (x - position) / span
            if not low <= slope <= high:
                break
            v = slope
            low = max(low, slope - self._resolution / span)
            high = min(high, slope + self._resolution / span)
        self._past.append((self._time, x))
        return Conditioned(x, v, f)


class StateVariableFilter(Conditioner):
    """Velocity as the derivative state of a second-order low-pass on position.

    Parameters
    ----------
    bandwidth
        Natural frequency of the filter [Hz].
    """

    def __init__(self, bandwidth: float) -> None:
        self._position = LowPass(bandwidth)
        self.settling = SETTLED_SECOND / angular(bandwidth)

    def reset(self) -> None:
        """Forget every sample."""
        self._position.reset()

    def _condition(self, x: float, f: float, dt: float) -> Conditioned:
        self._position.update(x, dt)
        return Conditioned(x, self._position.rate, f)


class MatchedFilter(Conditioner):
    """One state-variable filter on position and force alike, which keeps the regression exact.

    With H the filter, f = b v + k x implies H f = b H v + k H x: it suppresses noise and moves
    neither parameter. A way to get velocity that delays v alone by T gives, for motion at an
    angular frequency w, b / cos(w T) and k - b w tan(w T) in their place.

    A force channel that lags by a time constant makes b - k lag of the damping. Given its
    lag, position passes through the same lag, which makes force and position match again.

    Parameters
    ----------
    bandwidth
        Natural frequency of the filter [Hz].
    force_lag
        Time constant of the force channel [s], 0 for none.
    model
        The regressors. Each is formed from position and force as measured, and filtered then.

    References
    ----------
    P. C. Young, "Parameter estimation for continuous-time models: a survey", Automatica
    17(1), 1981 (state-variable filters).
    """

    def __init__(
        self, bandwidth: float = BANDWIDTH, force_lag: float = 0.0, model: Model = KELVIN_VOIGT
    ) -> None:
        self.model = model
        self._bandwidth = bandwidth
        self.settling = SETTLED_SECOND / angular(bandwidth) + SETTLED_FIRST * force_lag
        self._lag = Lag(force_lag)
        self._position = LowPass(bandwidth)
        self._force = LowPass(bandwidth)
        self._cube_lag = Lag(force_lag)
        self._cube = LowPass(bandwidth)

    def reset(self) -> None:
        """Forget every sample."""
        for part in (self._lag, self._position, self._force, self._cube_lag, self._cube):
            part.reset()

    def correlation(self, dt: float) -> float:
        """Samples, `dt` [s] apart, for each one whose noise of the force is independent.

        The equivalent noise bandwidth of this filter is pi/4 of its natural frequency.
        """
        return max(1.0, 2.0 / (math.pi * self._bandwidth * dt))

    def _condition(self, x: float, f: float, dt: float) -> Conditioned:
        position = self._position
        position.update(self._lag.update(x, dt), dt)
        self._force.update(f, dt)
        if not self.model.further:
            return Conditioned(position.y, position.rate, self._force.y)
        self._cube.update(self._cube_lag.update(x * x * x, dt), dt)
        regressors = {
            "f0": 1.0,
            "m": position.acceleration,
            "k3": self._cube.y,
            "tau": -self._force.rate,
        }
        further = tuple(regressors[parameter] for parameter in self.model.further)
        return Conditioned(position.y, position.rate, self._force.y, further)
