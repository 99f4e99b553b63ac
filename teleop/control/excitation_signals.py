"""Excitation signals: known functions of time that the slave follows in autonomous palpation."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal, NamedTuple


class Derivatives(NamedTuple):
    """Value and first two time derivatives of a signal at one time."""

    value: float
    """Value; dimensionless for an excitation signal, in metres for a displacement."""
    rate: float
    """First derivative [unit of the value per s]."""
    acceleration: float
    """Second derivative [unit of the value per s^2]."""


class Signal(ABC):
    """An excitation signal: a dimensionless function of time with values in [-1, 1].

    It must be continuous with its first derivative, because the injector computes a force from it.
    """

    kind: str = ""
    """Kind of the signal in the settings; empty for a signal of another package."""

    @property
    @abstractmethod
    def highest(self) -> float:
        """Highest frequency that the signal contains [Hz]."""

    @property
    @abstractmethod
    def text(self) -> str:
        """Short description: kind and frequencies."""

    @abstractmethod
    def at(self, t: float) -> Derivatives:
        """Return the value of the signal and its first two derivatives at time t [s]."""


@dataclass(frozen=True)
class Sine(Signal):
    """A sine, the excitation signal in the paper of Yamamoto et al. (BioRob 2008).

    Raises
    ------
    ValueError
        The frequency is not positive.
    """

    frequency: float
    """Frequency [Hz], > 0."""
    kind: Literal["sine"] = "sine"

    def __post_init__(self) -> None:
        if not 0.0 < self.frequency < math.inf:
            raise ValueError(f"excitation frequency must be positive, got {self.frequency}")

    @property
    def highest(self) -> float:
        """Highest frequency that the signal contains [Hz], which is the frequency of the sine."""
        return self.frequency

    @property
    def text(self) -> str:
        """Short description: kind and frequency."""
        return f"sine of {self.frequency:g} Hz"

    def at(self, t: float) -> Derivatives:
        """Return the value of the sine and its first two derivatives at time t [s]."""
        omega = 2.0 * math.pi * self.frequency
        sine, cosine = math.sin(omega * t), math.cos(omega * t)
        return Derivatives(sine, omega * cosine, -omega * omega * sine)


@dataclass(frozen=True)
class Multisine(Signal):
    """Sum of sines of equal amplitude, with the phases that Schroeder proposed.

    With these phases, the crest factor (the ratio of the peak to the root mean square) is low.

    Raises
    ------
    ValueError
        No frequency is given, or a frequency is not positive.

    References
    ----------
    M. R. Schroeder, "Synthesis of low-peak-factor signals", IEEE Trans. Inf. Theory 16, 1970.
    """

    frequencies: tuple[float, ...]
    """Frequencies [Hz], all > 0."""
    kind: Literal["multisine"] = "multisine"

    def __post_init__(self) -> None:
        if not self.frequencies or not all(0.0 < f < math.inf for f in self.frequencies):
            raise ValueError(
                f"excitation frequencies must be positive, got {list(self.frequencies)}"
            )

    @property
    def highest(self) -> float:
        """Highest frequency that the signal contains [Hz]."""
        return max(self.frequencies)

    @property
    def text(self) -> str:
        """Short description: kind and frequencies."""
        return f"multisine of {', '.join(f'{one:g}' for one in self.frequencies)} Hz"

    def at(self, t: float) -> Derivatives:
        """Return the value of the signal and its first two derivatives at time t [s]."""
        n = len(self.frequencies)
        value = rate = acceleration = 0.0
        for i, frequency in enumerate(self.frequencies):
            omega, phase = 2.0 * math.pi * frequency, -math.pi * i * i / n
            angle = omega * t + phase
            value += math.sin(angle)
            rate += omega * math.cos(angle)
            acceleration -= omega * omega * math.sin(angle)
        return Derivatives(value / n, rate / n, acceleration / n)


@dataclass(frozen=True)
class Chirp(Signal):
    """A sine whose frequency changes smoothly from `low` to `high` and back, repeatedly.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    low: float
    """Lowest frequency [Hz], > 0."""
    high: float
    """Highest frequency [Hz], > low."""
    sweep: float = 5.0
    """Time in which the frequency increases from low to high and decreases to low again [s],
    > 0."""
    kind: Literal["chirp"] = "chirp"

    def __post_init__(self) -> None:
        if not (0.0 < self.low < self.high < math.inf and 0.0 < self.sweep < math.inf):
            raise ValueError(
                "a chirp needs 0 < low < high and a positive sweep, got "
                f"{self.low}, {self.high}, {self.sweep}"
            )

    @property
    def highest(self) -> float:
        """Highest frequency of the chirp [Hz]."""
        return self.high

    @property
    def text(self) -> str:
        """Short description: kind, frequencies and time of a sweep."""
        return f"chirp from {self.low:g} to {self.high:g} Hz and back in {self.sweep:g} s"

    def at(self, t: float) -> Derivatives:
        """Return the value of the chirp and its first two derivatives at time t [s]."""
        mean = math.pi * (self.low + self.high)
        half = math.pi * (self.high - self.low)
        slow = 2.0 * math.pi / self.sweep
        phase = mean * t - half / slow * math.sin(slow * t)
        omega = mean - half * math.cos(slow * t)
        slew = half * slow * math.sin(slow * t)
        return Derivatives(
            math.sin(phase),
            omega * math.cos(phase),
            slew * math.cos(phase) - omega * omega * math.sin(phase),
        )


@dataclass(frozen=True)
class RampHold(Signal):
    """Repeated indentation: ramp from -1 to 1, hold, ramp back and rest.

    In the hold, the force of a specimen relaxes. The ramps are minimum-jerk movements.

    Raises
    ------
    ValueError
        A time is not positive.

    References
    ----------
    T. Flash, N. Hogan, J. Neurosci. 5(7), 1985 (minimum-jerk movement).
    """

    ramp: float = 0.1
    """Duration of each ramp [s], > 0."""
    hold: float = 2.0
    """Duration of the hold at 1 [s], > 0."""
    rest: float = 1.0
    """Duration of the rest at -1 [s], > 0."""
    kind: Literal["ramp-hold"] = "ramp-hold"

    def __post_init__(self) -> None:
        for name in ("ramp", "hold", "rest"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} of ramp-hold must be positive, got {getattr(self, name)}")

    @property
    def highest(self) -> float:
        """Frequency of the sine with the highest speed of a ramp [Hz]."""
        return 3.75 / (2.0 * math.pi * self.ramp)

    @property
    def text(self) -> str:
        """Short description: kind and times."""
        return f"ramps of {self.ramp:g} s, holds of {self.hold:g} s and rests of {self.rest:g} s"

    def at(self, t: float) -> Derivatives:
        """Return the value of the signal and its first two derivatives at time t [s]."""
        t %= 2.0 * self.ramp + self.hold + self.rest
        if t < self.ramp:
            return self._movement(t)
        t -= self.ramp + self.hold
        if t < 0.0:
            return Derivatives(1.0, 0.0, 0.0)
        if t < self.ramp:
            return Derivatives(*(-value for value in self._movement(t)))
        return Derivatives(-1.0, 0.0, 0.0)

    def _movement(self, t: float) -> Derivatives:
        """Return the minimum-jerk movement from -1 to 1 at the time t since its start [s]."""
        s = t / self.ramp
        return Derivatives(
            2.0 * s**3 * (10.0 - 15.0 * s + 6.0 * s * s) - 1.0,
            60.0 * (s * (1.0 - s)) ** 2 / self.ramp,
            120.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / self.ramp**2,
        )


@dataclass(frozen=True)
class Designed:
    """An excitation that is chosen while it runs (`teleop.control.designed_excitation`).

    Raises
    ------
    ValueError
        The frequency is not positive.
    """

    highest: float = 4.0
    """Highest frequency that may be chosen [Hz], > 0."""
    kind: Literal["designed"] = "designed"

    def __post_init__(self) -> None:
        if not 0.0 < self.highest < math.inf:
            raise ValueError(f"highest frequency must be positive, got {self.highest}")

    @property
    def text(self) -> str:
        """Short description: kind and highest frequency."""
        return f"designed during the trial, up to {self.highest:g} Hz"


AnySignal = Sine | Multisine | Chirp | RampHold | Designed
"""Types of excitation signal that a trial can have in its settings."""
SIGNALS: dict[str, type[Signal] | type[Designed]] = {
    "sine": Sine,
    "multisine": Multisine,
    "chirp": Chirp,
    "ramp-hold": RampHold,
    "designed": Designed,
}
"""Excitation signals by their kind in the settings."""
