"""The persistent-excitation (PE) injector: a force that moves the slave by a known signal."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

from teleop.control.admittance import AdmittanceParameters


class Motion(NamedTuple):
    """A signal and its first two time derivatives."""

    value: float
    rate: float
    acceleration: float


class Signal(ABC):
    """An excitation within [-1, 1]."""

    highest: float
    """Its highest frequency [Hz]."""

    @abstractmethod
    def at(self, t: float) -> Motion:
        """The signal at time t [s]."""


class Multisine(Signal):
    """Sum of sines of equal amplitude with Schroeder phases, which keep the crest low.

    Parameters
    ----------
    frequencies
        Frequencies [Hz], all positive.

    References
    ----------
    M. R. Schroeder, "Synthesis of low-peak-factor signals", IEEE Trans. Inf. Theory 16, 1970.
    """

    def __init__(self, frequencies: Sequence[float]) -> None:
        if not frequencies or not all(0.0 < f < math.inf for f in frequencies):
            raise ValueError(f"excitation frequencies must be positive, got {list(frequencies)}")
        self.highest = max(frequencies)
        n = len(frequencies)
        self._terms = [(2.0 * math.pi * f, -math.pi * i * i / n) for i, f in enumerate(frequencies)]

    def at(self, t: float) -> Motion:
        """The signal at time t [s]."""
        value = rate = acceleration = 0.0
        for omega, phase in self._terms:
            angle = omega * t + phase
            value += math.sin(angle)
            rate += omega * math.cos(angle)
            acceleration -= omega * omega * math.sin(angle)
        n = len(self._terms)
        return Motion(value / n, rate / n, acceleration / n)


class Sine(Multisine):
    """One sine, the paper's excitation.

    Parameters
    ----------
    frequency
        Frequency [Hz], positive.
    """

    def __init__(self, frequency: float) -> None:
        super().__init__([frequency])


class Chirp(Signal):
    """A sine whose frequency rises and falls again between two values, smoothly.

    Parameters
    ----------
    low, high
        Lowest and highest frequency [Hz], 0 < low < high.
    sweep
        Time [s] for one sweep up and down.
    """

    def __init__(self, low: float, high: float, sweep: float = 5.0) -> None:
        if not (0.0 < low < high < math.inf and 0.0 < sweep < math.inf):
            raise ValueError(
                f"a chirp needs 0 < low < high and a positive sweep, got {low}, {high}, {sweep}"
            )
        self.highest = high
        self._mean = math.pi * (low + high)
        self._half = math.pi * (high - low)
        self._slow = 2.0 * math.pi / sweep

    def at(self, t: float) -> Motion:
        """The signal at time t [s]."""
        phase = self._mean * t - self._half / self._slow * math.sin(self._slow * t)
        omega = self._mean - self._half * math.cos(self._slow * t)
        slew = self._half * self._slow * math.sin(self._slow * t)
        return Motion(
            math.sin(phase),
            omega * math.cos(phase),
            slew * math.cos(phase) - omega * omega * math.sin(phase),
        )


class Injector:
    """Force [N] that takes the master, and with it the slave, through an excitation.

    The slave stays between a light touch and a depth: x(t) = ramp(t) (mean + half signal(t)).
    The force is what the admittance needs for this motion, so contact holds whatever the
    signal, and a sine of displacement is a sine of force.

    Parameters
    ----------
    signal
        The excitation.
    depth
        Greatest displacement of the slave [m], > 0.
    admittance
        The virtual dynamics that the force acts on.
    scale
        Slave motion for a unit of master motion.
    duration
        Length of the trial [s], at the end of which the slave is back at zero.
    touch
        Least displacement, as a share of the depth, 0 <= touch < 1.
    ramp
        Time to ramp in and to ramp out [s]; at most half the duration is used.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    def __init__(
        self,
        signal: Signal,
        depth: float,
        admittance: AdmittanceParameters,
        scale: float,
        duration: float,
        touch: float = 0.1,
        ramp: float = 0.5,
    ) -> None:
        if not 0.0 < depth < math.inf:
            raise ValueError(f"excitation depth must be positive, got {depth} m")
        if not (0.0 < duration < math.inf and 0.0 < ramp < math.inf):
            raise ValueError(f"duration and ramp must be positive, got {duration} s and {ramp} s")
        if not 0.0 <= touch < 1.0:
            raise ValueError(f"touch must be in [0, 1), got {touch}")
        if not 0.0 < scale < math.inf:
            raise ValueError(f"motion scale must be positive, got {scale}")
        self._signal = signal
        self._mean = 0.5 * depth * (1.0 + touch) / scale
        self._half = 0.5 * depth * (1.0 - touch) / scale
        self._admittance = admittance
        self._duration = duration
        self._ramp = min(ramp, 0.5 * duration)

    def motion(self, t: float) -> Motion:
        """Motion of the master at time t [s]: position [m], velocity, acceleration."""
        in_out, sign = (t, 1.0) if 2.0 * t < self._duration else (self._duration - t, -1.0)
        u = min(max(in_out / self._ramp, 0.0), 1.0)
        ramp = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        ramp_rate = sign * 30.0 * u * u * (1.0 - u) ** 2 / self._ramp
        ramp_acceleration = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / self._ramp**2
        signal = self._signal.at(t)
        offset = self._mean + self._half * signal.value
        return Motion(
            ramp * offset,
            ramp_rate * offset + ramp * self._half * signal.rate,
            ramp_acceleration * offset
            + 2.0 * ramp_rate * self._half * signal.rate
            + ramp * self._half * signal.acceleration,
        )

    def force(self, t: float) -> float:
        """Force [N] on the admittance at time t [s]."""
        return self._admittance.force(*self.motion(t))
