"""Condition signals: filter position and force, and compute the regressors of a model."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.arrays import Floats
from estimation.checks import checked_samples, is_valid, sample_error
from estimation.compiled import looped
from estimation.filters import Delay, Lag, LowPass, Play, angular, difference, difference_series
from estimation.model import KELVIN_VOIGT, Model

BANDWIDTH = 20.0
"""Default bandwidth of a filter of position and force [Hz].

It is ten times the largest frequency of palpation by hand, about 2 Hz. A smaller bandwidth removes
more noise. `python benchmarks/conditioning.py` compares 10, 20 and 50 Hz.
"""
SETTLED_FIRST, SETTLED_SECOND = 4.605, 6.638
"""Time after which the error of the step response is 1 %, in time constants.

The values are those of a first-order lag and of a critically damped second-order filter.
"""


class ConditionedSample(NamedTuple):
    """Filtered regressors and filtered force of one sample."""

    x: float
    """Displacement [m]."""
    v: float
    """Velocity [m/s]."""
    f: float
    """Force [N]."""
    further: tuple[float, ...] = ()
    """The model's regressors besides v and x."""


class Regression(NamedTuple):
    """Filtered regressors and force of n samples. The fields are the arguments of `Bank.run`."""

    x: Floats
    """Displacement [m], shape (n,)."""
    v: Floats
    """Velocity [m/s], shape (n,)."""
    f: Floats
    """Force [N], shape (n,)."""
    dt: Floats
    """Time since the previous sample [s], shape (n,)."""
    further: Floats
    """The model's regressors besides v and x, shape (n, regressors - 2)."""

    def part(self, samples: slice | NDArray[np.intp] | NDArray[np.bool_]) -> Regression:
        """Return some of the samples. `samples` is a slice, an array of indices, or a mask."""
        return Regression(*(channel[samples] for channel in self))


class Conditioner(ABC):
    """Base class of filters that compute x, v and f from measured position and force."""

    settling = 0.0
    """Time from the first sample until the transient of the filter has decayed to 1 % [s]."""

    @abstractmethod
    def reset(self) -> None:
        """Reset the filter to its state before the first sample."""

    def update(self, x: float, f: float, dt: float) -> ConditionedSample:
        """Filter one sample: position x [m], force f [N], time `dt` [s] since the previous sample.

        Raises
        ------
        ValueError
            A value is not finite or too large, or `dt` is not positive. In this case, the state
            of the filter does not change.
        """
        if not is_valid(dt, abs(x) + abs(f)):
            raise sample_error(dt, x=x, f=f)
        return self._condition(x, f, dt)

    @abstractmethod
    def _condition(self, x: float, f: float, dt: float) -> ConditionedSample:
        """Filter one sample. The caller, `update`, has checked that the values are valid."""

    def correlation(self, dt: float) -> float:
        """Return (number of samples) / (number of independent values of the force noise in them).

        The ratio is 1 for white noise, and larger for correlated noise. `dt`: sample period [s].
        """
        return 1.0

    def run(self, x: ArrayLike, f: ArrayLike, dt: ArrayLike) -> Regression:
        """Filter n samples, with the same results as n calls of `update`.

        Raises
        ------
        ValueError
            The shapes differ, a value is not finite or too large, or a `dt` is not positive.
        """
        samples = checked_samples(x, x, f, dt)
        return self._condition_all(samples.phi[:, 1].copy(), samples.f, samples.dt)

    def _condition_all(self, x: Floats, f: Floats, dt: Floats) -> Regression:
        """Filter n samples. The caller, `run`, has checked that the values are valid."""
        rows = zip(x.tolist(), f.tolist(), dt.tolist(), strict=True)
        out = np.array(
            [(c.x, c.v, c.f, *c.further) for c in (self._condition(*row) for row in rows)]
        ).reshape(len(x), -1 if len(x) else 3)
        columns = out.T.copy()
        return Regression(columns[0], columns[1], columns[2], dt, out[:, 3:].copy())


class FilteredDifference(Conditioner):
    """Compute velocity by a difference quotient of the position and a first-order low-pass filter.

    Parameters
    ----------
    bandwidth
        Corner frequency of the low-pass filter [Hz].
    """

    def __init__(self, bandwidth: float) -> None:
        self._omega = angular(bandwidth)
        self.settling = SETTLED_FIRST / self._omega
        self.reset()

    def reset(self) -> None:
        """Reset the filter to its state before the first sample."""
        self._x = math.nan
        self._v = 0.0

    def _condition(self, x: float, f: float, dt: float) -> ConditionedSample:
        if not math.isnan(self._x):
            self._v = difference(self._omega, self._x, self._v, x, dt)
        self._x = x
        return ConditionedSample(x, self._v, f)

    def _condition_all(self, x: Floats, f: Floats, dt: Floats) -> Regression:
        v = np.empty(len(x))
        if len(x):
            before = float(x[0]) if math.isnan(self._x) else self._x
            looped(difference_series, (self._omega, before, self._v), (x, dt), (v,))
            self._x, self._v = float(x[-1]), float(v[-1])
        return Regression(x, v, f, dt, np.empty((len(x), 0)))


class FirstOrderAdaptiveWindowing(Conditioner):
    """Compute velocity by first-order adaptive windowing (FOAW), in the end-fit variant.

    The velocity is the slope (over time) of the line from the oldest to the newest position in a
    window. The window is as long as possible, but every position in it must differ from this line
    by at most `resolution`. At rest the window is long, which gives low noise. In motion the window
    is short, which gives a small delay.

    Parameters
    ----------
    resolution
        Largest error of a position sample [m], for example the distance per encoder count.
    longest
        Largest number of sample periods in the window.

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
        """Reset the filter to its state before the first sample."""
        self._past.clear()
        self._time = 0.0

    def _condition(self, x: float, f: float, dt: float) -> ConditionedSample:
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
        return ConditionedSample(x, v, f)


class StateVariableFilter(Conditioner):
    """Compute velocity as the derivative y' of the output y of a low-pass filter of the position.

    Parameters
    ----------
    bandwidth
        Natural frequency of the filter, which is of second order and critically damped [Hz].
    """

    def __init__(self, bandwidth: float) -> None:
        self._position = LowPass(bandwidth)
        self.settling = SETTLED_SECOND / angular(bandwidth)

    def reset(self) -> None:
        """Reset the filter to its state before the first sample."""
        self._position.reset()

    def _condition(self, x: float, f: float, dt: float) -> ConditionedSample:
        self._position.update(x, dt)
        return ConditionedSample(x, self._position.rate, f)


class MatchedFilter(Conditioner):
    """Apply the same second-order low-pass filter to position and force.

    The velocity is a state of the filter of the position. For every linear filter H,
    f = b v + k x implies H f = b H v + k H x. So the filter reduces noise without bias in b or k.
    A filter that delays only v would cause a bias: for a delay T and motion at the angular
    frequency w, the estimates would be b / cos(w T) and k - b w tan(w T).

    A lag of the force channel with the time constant T_f biases the estimated damping to about
    b - k T_f. If `force_lag` is T_f, the same lag is applied to the position to remove this bias.

    Parameters
    ----------
    bandwidth
        Natural frequency of the filter [Hz].
    force_lag
        Time constant of the lag of the force channel [s]; 0 for no lag.
    model
        Model that defines the regressors. Each regressor is computed from the measured position
        and force, and is then filtered.

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
        """Reset the filter to its state before the first sample."""
        for part in (self._lag, self._position, self._force, self._cube_lag, self._cube):
            part.reset()

    def correlation(self, dt: float) -> float:
        """Return (number of samples) / (number of independent values of the force noise in them).

        The filter makes the noise correlated. The ratio is computed from the noise bandwidth of
        the filter, which is pi/4 times its natural frequency. `dt` is the sample period [s].
        """
        return max(1.0, 2.0 / (math.pi * self._bandwidth * dt))

    def _condition(self, x: float, f: float, dt: float) -> ConditionedSample:
        position = self._position
        position.update(self._lag.update(x, dt), dt)
        self._force.update(f, dt)
        if not self.model.further:
            return ConditionedSample(position.y, position.rate, self._force.y)
        self._cube.update(self._cube_lag.update(x * x * x, dt), dt)
        regressors = {
            "f0": 1.0,
            "m": position.acceleration,
            "k3": self._cube.y,
            "tau": -self._force.rate,
        }
        further = tuple(regressors[parameter] for parameter in self.model.further)
        return ConditionedSample(position.y, position.rate, self._force.y, further)

    def _condition_all(self, x: Floats, f: Floats, dt: Floats) -> Regression:
        y, rate, acceleration = self._position.run(self._lag.run(x, dt), dt)
        force, force_rate, _ = self._force.run(f, dt)
        regressors = {"f0": np.ones(len(x)), "m": acceleration, "tau": -force_rate}
        if "k3" in self.model.further:
            regressors["k3"] = self._cube.run(self._cube_lag.run(x * x * x, dt), dt)[0]
        further = [regressors[parameter] for parameter in self.model.further]
        return Regression(y, rate, force, dt, np.reshape(further, (len(further), len(x))).T.copy())


class OfFilteredPosition(Conditioner):
    """Base of the conditioners that filter the position before another conditioner."""

    def __init__(self, conditioner: Conditioner, position_filter: Delay | Play) -> None:
        self._conditioner = conditioner
        self._position_filter = position_filter
        self.settling = conditioner.settling

    def reset(self) -> None:
        """Reset both filters to their states before the first sample."""
        self._position_filter.reset()
        self._conditioner.reset()

    def correlation(self, dt: float) -> float:
        """Return the `correlation` of the other conditioner."""
        return self._conditioner.correlation(dt)


class WithDelay(OfFilteredPosition):
    """Delay the position by the pure delay of the force channel, before another conditioner.

    Parameters
    ----------
    conditioner
        The conditioner that receives the delayed position and the measured force.
    delay
        Pure delay of the force channel [s].
    """

    def __init__(self, conditioner: Conditioner, delay: float) -> None:
        self._delay = Delay(delay)
        super().__init__(conditioner, self._delay)
        self.settling += delay

    def _condition(self, x: float, f: float, dt: float) -> ConditionedSample:
        return self._conditioner._condition(self._delay.update(x, dt), f, dt)

    def _condition_all(self, x: Floats, f: Floats, dt: Floats) -> Regression:
        return self._conditioner._condition_all(self._delay.run(x, dt), f, dt)


class WithoutLostMotion(OfFilteredPosition):
    """Remove the lost motion of the transmission from the position, before another conditioner.

    The position at the encoder is replaced by the output of the play operator. This is the position
    of the tip plus the stretch of the transmission. The first output is the first position.

    Parameters
    ----------
    conditioner
        The conditioner that receives this position.
    lost_motion
        Half width of the play [m].
    """

    def __init__(self, conditioner: Conditioner, lost_motion: float) -> None:
        self._play = Play(lost_motion)
        super().__init__(conditioner, self._play)

    def _condition(self, x: float, f: float, dt: float) -> ConditionedSample:
        return self._conditioner._condition(self._play.update(x), f, dt)

    def _condition_all(self, x: Floats, f: Floats, dt: Floats) -> Regression:
        return self._conditioner._condition_all(self._play.run(x), f, dt)


CONDITIONERS = ("matched", "svf", "foaw", "difference")
"""Names of the signal conditioners."""
LONGEST_LAG = 0.5
"""Largest time constant of a lag of the force channel that can be compensated [s]."""


def make_conditioner(
    name: str,
    bandwidth: float,
    resolution: float,
    force_lag: float = 0.0,
    model: Model = KELVIN_VOIGT,
    lost_motion: float = 0.0,
    delay_share: float = 0.0,
) -> Conditioner:
    """Return a new signal conditioner with this name.

    A signal conditioner is a filter that computes displacement, velocity and force from the
    measured position and force.

    `bandwidth` [Hz] is not used by `foaw`. `resolution`, the distance per encoder count [m], is
    used only by `foaw`. Only `matched` supports a `force_lag` [s] and regressors besides v and x.
    `delay_share`, from 0 to 1, is the share of a pure delay in this lag; the rest is of first
    order. All of them support the half width of the play between encoder and tip, `lost_motion`
    [m]. ValueError otherwise, or if a number is out of its range.
    """
    if name not in CONDITIONERS:
        raise ValueError(f"conditioning {name!r}: expected one of {', '.join(CONDITIONERS)}")
    if force_lag != 0.0 and name != "matched":
        raise ValueError(f"force lag {force_lag:g} s: expected conditioning matched, not {name}")
    if force_lag > LONGEST_LAG:
        raise ValueError(f"force lag {force_lag:g} s: expected at most {LONGEST_LAG:g} s")
    if not 0.0 <= delay_share <= 1.0:
        raise ValueError(f"delay share {delay_share:g}: expected 0 to 1")
    if model.further and name != "matched":
        raise ValueError(f"model {model.name}: expected conditioning matched, not {name}")
    made: Conditioner
    try:
        angular(bandwidth)
        if name == "matched":
            made = MatchedFilter(bandwidth, (1.0 - delay_share) * force_lag, model)
            if delay := delay_share * force_lag:
                made = WithDelay(made, delay)
        elif name == "svf":
            made = StateVariableFilter(bandwidth)
        elif name == "difference":
            made = FilteredDifference(bandwidth)
        else:
            made = FirstOrderAdaptiveWindowing(resolution)
        return WithoutLostMotion(made, lost_motion) if lost_motion else made
    except ValueError as error:
        raise ValueError(f"conditioning {name}: {error}") from error
