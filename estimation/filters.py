"""Discrete-time filters that are exact for an input that is linear between samples."""

from __future__ import annotations

import math


class LowPass:
    """Critically damped second-order low-pass filter with input u and output y.

        y'' + 2 w y' + w^2 y = w^2 u,    w = 2 pi bandwidth

    The discretisation is exact for every `dt` if the input is linear between samples. The first
    sample sets y = u and y' = 0.

    Parameters
    ----------
    bandwidth
        Natural frequency [Hz].

    Attributes
    ----------
    y
        Output.
    rate
        Derivative y' of the output [1/s].
    """

    def __init__(self, bandwidth: float) -> None:
        self._omega = angular(bandwidth)
        self.reset()

    def reset(self) -> None:
        """Discard all samples."""
        self._u = math.nan
        self.y = self.rate = 0.0

    def update(self, u: float, dt: float) -> None:
        """Advance by `dt` [s]. During this time the input changes linearly to u."""
        omega = self._omega
        if math.isnan(self._u):
            self._u = self.y = u
        ramp = (u - self._u) / dt
        lag = 2.0 * ramp / omega
        decay = math.exp(-omega * dt)
        offset = self.y - self._u + lag
        slope = self.rate - ramp + omega * offset
        self.y = u - lag + (offset + slope * dt) * decay
        self.rate = ramp + (slope - omega * (offset + slope * dt)) * decay
        self._u = u

    @property
    def acceleration(self) -> float:
        """Second derivative y'' of the output."""
        return self._omega * (self._omega * (self._u - self.y) - 2.0 * self.rate)


class Lag:
    """First-order lag tau y' = u - y with input u and output y.

    The discretisation is exact for every `dt` if the input is linear between samples. The first
    sample sets y = u.

    Parameters
    ----------
    lag
        Time constant tau [s], >= 0.

    Raises
    ------
    ValueError
        The time constant is negative or not finite.
    """

    def __init__(self, lag: float) -> None:
        if not 0.0 <= lag < math.inf:
            raise ValueError(f"lag must be >= 0, got {lag} s")
        self._lag = lag
        self.reset()

    def reset(self) -> None:
        """Discard all samples."""
        self._u = self.y = math.nan

    def update(self, u: float, dt: float) -> float:
        """Advance by `dt` [s] with an input that changes linearly to u; return the output."""
        if self._lag == 0.0 or math.isnan(self._u):
            self.y = u
        else:
            behind = (u - self._u) / dt * self._lag
            self.y = u - behind + (self.y - self._u + behind) * math.exp(-dt / self._lag)
        self._u = u
        return self.y


def angular(bandwidth: float) -> float:
    """Return 2 pi times a frequency [Hz].

    Raises
    ------
    ValueError
        The frequency is not between 1e-6 and 1e6 Hz.
    """
    if not 1e-6 <= bandwidth <= 1e6:
        raise ValueError(f"bandwidth must be positive, 1e-6 to 1e6 Hz, got {bandwidth} Hz")
    return 2.0 * math.pi * bandwidth
