"""Define linear filters in discrete time.

The filters are exact if the input changes linearly between the samples.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from estimation.arrays import Floats
from estimation.compiled import looped


def low_pass(
    omega: float, u_before: float, y: float, rate: float, u: float, dt: float
) -> tuple[float, float]:
    """Return the output of a `LowPass` and the derivative of the output, after one sample.

    During the time `dt` [s], the input changes linearly from `u_before` to `u`. `y` and `rate` are
    the output and its derivative before this time. `omega` is the natural frequency [rad/s].
    """
    ramp = (u - u_before) / dt
    lag = 2.0 * ramp / omega
    decay = math.exp(-omega * dt)
    offset = y - u_before + lag
    slope = rate - ramp + omega * offset
    return (
        u - lag + (offset + slope * dt) * decay,
        ramp + (slope - omega * (offset + slope * dt)) * decay,
    )


def low_pass_series(
    omega: float,
    u_before: float,
    y: float,
    rate: float,
    u: Sequence[float],
    dt: Sequence[float],
    ys: Any,
    rates: Any,
) -> None:
    """Apply `low_pass` to n inputs `u`, and write the results to `ys` and `rates`.

    `ys` receives the n outputs, and `rates` receives their derivatives. `dt` contains the n times
    since the previous input [s].
    """
    for i in range(len(u)):
        y, rate = low_pass(omega, u_before, y, rate, u[i], dt[i])
        u_before = u[i]
        ys[i] = y
        rates[i] = rate


def first_order_lag(lag: float, u_before: float, y: float, u: float, dt: float) -> float:
    """Return the output of a `Lag` after one sample.

    During the time `dt` [s], the input changes linearly from `u_before` to `u`. `y` is the output
    before this time. `lag` is the time constant [s].
    """
    behind = (u - u_before) / dt * lag
    return u - behind + (y - u_before + behind) * math.exp(-dt / lag)


def lag_series(
    lag: float, u_before: float, y: float, u: Sequence[float], dt: Sequence[float], ys: Any
) -> None:
    """Apply `first_order_lag` to n inputs `u`, and write the n outputs to `ys`."""
    for i in range(len(u)):
        y = first_order_lag(lag, u_before, y, u[i], dt[i])
        u_before = u[i]
        ys[i] = y


def difference(omega: float, u_before: float, y: float, u: float, dt: float) -> float:
    """Return the difference quotient of an input, filtered by a first-order low-pass filter.

    `u_before` and `u` are the inputs before and after the time `dt` [s]. The difference quotient is
    (u - u_before) / dt. `y` is the output of the filter before this time, and `omega` is the corner
    frequency of the filter [rad/s].
    """
    return y - math.expm1(-omega * dt) * ((u - u_before) / dt - y)


def difference_series(
    omega: float, u_before: float, y: float, u: Sequence[float], dt: Sequence[float], ys: Any
) -> None:
    """Apply `difference` to n inputs `u`, and write the n outputs to `ys`."""
    for i in range(len(u)):
        y = difference(omega, u_before, y, u[i], dt[i])
        u_before = u[i]
        ys[i] = y


class LowPass:
    """Critically damped second-order low-pass filter with input u and output y.

        y'' + 2 w y' + w^2 y = w^2 u,    w = 2 pi bandwidth

    The discretisation is exact for every `dt` if the input is linear between samples. The first
    sample sets y = u and y' = 0.

    `bandwidth` is the natural frequency w / (2 pi) [Hz], from 1e-6 to 1e6 Hz.

    Attributes
    ----------
    y
        Output.
    rate
        Time derivative y' of the output, in the unit of y per second.
    """

    def __init__(self, bandwidth: float) -> None:
        self._omega = angular(bandwidth)
        self.reset()

    def reset(self) -> None:
        """Discard all inputs. The next input is processed as the first input."""
        self._u = math.nan
        self.y = self.rate = 0.0

    def update(self, u: float, dt: float) -> None:
        """Process one input, and update the outputs `y` and `rate`.

        During the time `dt` [s], the input changes linearly from the previous input to `u`.
        """
        omega = self._omega
        if math.isnan(self._u):
            self._u = self.y = u
        self.y, self.rate = low_pass(omega, self._u, self.y, self.rate, u, dt)
        self._u = u

    def run(self, u: Floats, dt: Floats) -> tuple[Floats, Floats, Floats]:
        """Process n inputs like n calls of `update`; return y, y' and y'' after each input."""
        y, rate = np.empty(len(u)), np.empty(len(u))
        if len(u):
            if math.isnan(self._u):
                self._u = self.y = float(u[0])
            looped(low_pass_series, (self._omega, self._u, self.y, self.rate), (u, dt), (y, rate))
            self._u, self.y, self.rate = float(u[-1]), float(y[-1]), float(rate[-1])
        return y, rate, self._omega * (self._omega * (u - y) - 2.0 * rate)

    @property
    def acceleration(self) -> float:
        """Second time derivative y'' of the output, in the unit of y per second squared."""
        return self._omega * (self._omega * (self._u - self.y) - 2.0 * self.rate)


class Lag:
    """First-order lag tau y' = u - y with input u and output y.

    The discretisation is exact for every `dt` if the input is linear between samples. The first
    sample sets y = u.

    `lag` is tau [s], >= 0.
    """

    def __init__(self, lag: float) -> None:
        if not 0.0 <= lag < math.inf:
            raise ValueError(f"lag must be >= 0, got {lag} s")
        self._lag = lag
        self.reset()

    def reset(self) -> None:
        """Discard all inputs. The next input is processed as the first input."""
        self._u = self.y = math.nan

    def update(self, u: float, dt: float) -> float:
        """Process one input, and return the output.

        During the time `dt` [s], the input changes linearly from the previous input to `u`.
        """
        if self._lag == 0.0 or math.isnan(self._u):
            self.y = u
        else:
            self.y = first_order_lag(self._lag, self._u, self.y, u, dt)
        self._u = u
        return self.y

    def run(self, u: Floats, dt: Floats) -> Floats:
        """Process n inputs; return n outputs, which are those of n calls of `update`.

        `u` contains the inputs, and `dt` the times since the previous input [s].
        """
        if self._lag == 0.0 or not len(u):
            self._u = float(u[-1]) if len(u) else self._u
            self.y = self._u
            return u
        if math.isnan(self._u):
            self._u = self.y = float(u[0])
        y = np.empty(len(u))
        looped(lag_series, (self._lag, self._u, self.y), (u, dt), (y,))
        self._u, self.y = float(u[-1]), float(y[-1])
        return y


class Delay:
    """Pure delay y(t) = u(t - T) with input u and output y.

    The output is exact for every `dt` if the input is linear between samples. Before the first
    sample, the input has the value of the first sample.

    `delay` is T [s], >= 0.
    """

    def __init__(self, delay: float) -> None:
        if not 0.0 <= delay < math.inf:
            raise ValueError(f"delay must be >= 0, got {delay} s")
        self._delay = delay
        self._past: deque[tuple[float, float]] = deque()
        self.reset()

    def reset(self) -> None:
        """Discard all inputs. The next input is processed as the first input."""
        self._past.clear()
        self._time = 0.0

    def update(self, u: float, dt: float) -> float:
        """Process one input, and return the output.

        During the time `dt` [s], the input changes linearly from the previous input to `u`.
        """
        if self._delay == 0.0:
            return u
        past = self._past
        self._time += dt
        past.append((self._time, u))
        t = self._time - self._delay
        while len(past) > 1 and past[1][0] <= t:
            past.popleft()
        start, before = past[0]
        if t <= start:
            return before
        end, after = past[1]
        return before + (after - before) * ((t - start) / (end - start))

    def run(self, u: Floats, dt: Floats) -> Floats:
        """Process n inputs; return n outputs, which are those of n calls of `update`.

        `u` contains the inputs, and `dt` the times since the previous input [s].
        """
        if self._delay == 0.0 or not len(u):
            return u
        return np.array(list(map(self.update, u.tolist(), dt.tolist())))


class Play:
    """Play operator (backlash) of half width d with input u and output y.

    The output is constant while it differs from the input by at most d. Otherwise it follows the
    input at the distance d. The first sample sets y = u.

    `half_width` is d, >= 0, in the unit of u.

    References
    ----------
    M. Brokate, J. Sprekels, "Hysteresis and Phase Transitions", Springer, 1996, section 2.1.
    """

    def __init__(self, half_width: float) -> None:
        if not 0.0 <= half_width < math.inf:
            raise ValueError(f"half width of the play must be >= 0, got {half_width}")
        self._half_width = half_width
        self.reset()

    def reset(self) -> None:
        """Discard all inputs. The next input is processed as the first input."""
        self.y = math.nan

    def update(self, u: float) -> float:
        """Process one input, and return the output."""
        d = self._half_width
        if not abs(self.y - u) <= d:
            self.y = u if math.isnan(self.y) else u - d if self.y < u else u + d
        return self.y

    def run(self, u: Floats) -> Floats:
        """Process n inputs; return n outputs, which are those of n calls of `update`."""
        if self._half_width == 0.0 or not len(u):
            return u
        return np.array([self.update(value) for value in u.tolist()])


def angular(bandwidth: float) -> float:
    """Return the angular frequency [rad/s] of a bandwidth from 1e-6 to 1e6 Hz."""
    if not 1e-6 <= bandwidth <= 1e6:
        raise ValueError(f"bandwidth must be positive, 1e-6 to 1e6 Hz, got {bandwidth} Hz")
    return 2.0 * math.pi * bandwidth
