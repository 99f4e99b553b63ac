"""Phases of a protocol, such as a ramp or a hold, and the steps that they consist of.

A phase is what a user states. A step is what the controller performs and what the evaluation looks
at: one motion or one hold, with one controlled quantity. A phase that states a `depth` controls the
position of the slave, and one that states a `force` controls the contact force. Depths are measured
from the contact point that the last `approach` has found, or from the contact datum of the rig.
"""

from __future__ import annotations

import math
import random
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Literal, NamedTuple

from teleop.control.excitation_signals import Chirp

Quantity = Literal["position", "force"]
LONGEST_APPROACH = 20e-3
"""Way of an approach to the depth of the trial, for the duration of the protocol [m]."""
AMPLITUDE = 0.5e-3
"""Usual amplitude about a depth [m]."""
ONSET = 1
"""Number of cycles in which a periodic motion begins, and in which it ends."""
TONES = 20
"""Number of sines of a random motion."""
SAMPLES = 8
"""Number of times in a period of the highest frequency at which the peak is looked for."""


class Reference(NamedTuple):
    """Reference of the controlled quantity at one time."""

    value: float
    """Value, relative to the contact point [m], or force [N]."""
    rate: float
    """Time derivative of the value [m/s or N/s]."""


@dataclass(frozen=True)
class Step(ABC):
    """One motion or hold of a protocol."""

    phase: int
    """Number of the phase to which the step belongs, from 1."""
    by: Quantity
    """Controlled quantity."""

    kind = ""
    """What the evaluation computes from the step."""

    @property
    @abstractmethod
    def text(self) -> str:
        """Short description, for the live page and tables."""

    @abstractmethod
    def duration(self, start: float) -> float:
        """Return the duration [s], for a controlled quantity with this value at the start."""

    @abstractmethod
    def reference(self, t: float, start: float) -> Reference:
        """Return the reference, t [s] after the start of the step."""


@dataclass(frozen=True)
class Move(Step):
    """A minimum-jerk movement to a value, of a stated duration or with a stated highest speed."""

    goal: float
    time: float | None = None
    """Duration [s]; None if `speed` determines it."""
    speed: float | None = None
    """Highest speed [m/s or N/s]."""
    kind = "move"

    @property
    def text(self) -> str:
        """Short description."""
        return f"to {quantity_text(self.goal, self.by)}"

    def duration(self, start: float) -> float:
        """Return the duration [s]."""
        if self.time is not None:
            return self.time
        return 1.875 * abs(self.goal - start) / (self.speed or math.inf)

    def reference(self, t: float, start: float) -> Reference:
        """Return the reference."""
        time = self.duration(start)
        if not t < time:
            return Reference(self.goal, 0.0)
        s, way = max(t, 0.0) / time, self.goal - start
        return Reference(
            start + way * s**3 * (10.0 - 15.0 * s + 6.0 * s * s),
            way * 30.0 * (s * (1.0 - s)) ** 2 / time,
        )


@dataclass(frozen=True)
class Stay(Step):
    """A hold of the value at its start: the force relaxes, or the specimen creeps."""

    time: float
    """Duration [s]."""

    @property
    def kind(self) -> str:  # type: ignore[override]
        """What the evaluation computes: relaxation of the force, or creep."""
        return "relaxation" if self.by == "position" else "creep"

    @property
    def text(self) -> str:
        """Short description."""
        return f"hold {self.by} for {self.time:g} s"

    def duration(self, start: float) -> float:
        """Return the duration [s]."""
        return self.time

    def reference(self, t: float, start: float) -> Reference:
        """Return the reference."""
        return Reference(start, 0.0)


@dataclass(frozen=True)
class Rest(Stay):
    """A hold out of contact, which is not evaluated."""

    kind = "rest"

    @property
    def text(self) -> str:
        """Short description."""
        return f"rest for {self.time:g} s"


@dataclass(frozen=True)
class Seek(Step):
    """A motion with constant speed until the contact force reaches a value."""

    force: float
    speed: float
    deepest: float | None
    """Position at which the approach ends [m]; None for the depth of the trial."""
    kind = "approach"

    @property
    def text(self) -> str:
        """Short description."""
        return f"approach until {self.force:g} N"

    def duration(self, start: float) -> float:
        """Return the longest duration [s]."""
        deepest = LONGEST_APPROACH if self.deepest is None else self.deepest
        return max(deepest - start, 0.0) / self.speed

    def reference(self, t: float, start: float) -> Reference:
        """Return the reference, which begins to move without a step of the velocity."""
        rise = 0.1
        late = max(t - rise, 0.0)
        inside = min(t, rise)
        way = self.speed * (0.5 * inside * inside / rise + late)
        return Reference(start + way, self.speed * inside / rise)


@dataclass(frozen=True)
class Oscillate(Step):
    """A sum of sines about a value, which begins and ends smoothly."""

    mean: float
    amplitude: float
    tones: tuple[tuple[float, float, float], ...]
    """Frequency [Hz], share of the amplitude and phase [rad] of each sine."""
    time: float
    """Duration [s]."""
    rise: float
    """Duration of the onset, and of the end [s]."""

    @property
    def kind(self) -> str:  # type: ignore[override]
        """What the evaluation computes: k' and k'' of a sine, or k and b of a broad motion."""
        return "cyclic" if len(self.tones) == 1 else "random"

    @property
    def text(self) -> str:
        """Short description."""
        size = quantity_text(self.amplitude, self.by)
        frequencies = [frequency for frequency, _, _ in self.tones]
        if len(frequencies) == 1:
            return f"sine of {frequencies[0]:g} Hz, {size}"
        return f"random from {min(frequencies):.3g} to {max(frequencies):.3g} Hz, {size}"

    def duration(self, start: float) -> float:
        """Return the duration [s]."""
        return self.time

    def reference(self, t: float, start: float) -> Reference:
        """Return the reference."""
        window, window_rate = onset(t, self.time, self.rise)
        value = rate = 0.0
        for frequency, share, phase in self.tones:
            omega = 2.0 * math.pi * frequency
            value += share * math.sin(omega * t + phase)
            rate += share * omega * math.cos(omega * t + phase)
        size = self.amplitude
        return Reference(
            self.mean + size * window * value, size * (window_rate * value + window * rate)
        )


@dataclass(frozen=True)
class SweepFrequency(Step):
    """A sine about a value, whose frequency increases and decreases again."""

    mean: float
    amplitude: float
    low: float
    high: float
    time: float
    """Duration [s]."""
    kind = "sweep"

    @property
    def text(self) -> str:
        """Short description."""
        size = quantity_text(self.amplitude, self.by)
        return f"sweep from {self.low:g} to {self.high:g} Hz, {size}"

    def duration(self, start: float) -> float:
        """Return the duration [s]."""
        return self.time

    def reference(self, t: float, start: float) -> Reference:
        """Return the reference."""
        window, window_rate = onset(t, self.time, min(1.0 / self.low, 0.25 * self.time))
        value, rate, _ = Chirp(self.low, self.high, self.time).at(t)
        size = self.amplitude
        return Reference(
            self.mean + size * window * value, size * (window_rate * value + window * rate)
        )


def onset(t: float, duration: float, rise: float) -> tuple[float, float]:
    """Return a window that rises from 0 to 1 and falls to 0 again, and its derivative [1/s]."""
    inside, sign = (t, 1.0) if 2.0 * t < duration else (duration - t, -1.0)
    u = min(max(inside / rise, 0.0), 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u), sign * 30.0 * (u * (1.0 - u)) ** 2 / rise


def quantity_text(value: float, by: Quantity) -> str:
    """Return a position or a force with its unit."""
    return f"{value * 1e3:.4g} mm" if by == "position" else f"{value:.4g} N"


@dataclass(frozen=True)
class Phase(ABC):
    """One part of a protocol, as a user states it.

    Raises
    ------
    ValueError
        A value is out of its range, or both or neither of `depth` and `force` are stated.
    """

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            values = value if isinstance(value, tuple) else (value,)
            if any(isinstance(one, float) and not math.isfinite(one) for one in values):
                raise ValueError(f"{field.name}: expected finite numbers, got {value}")
            if field.name in POSITIVE and any(one is not None and one <= 0.0 for one in values):
                raise ValueError(f"{field.name}: expected more than 0, got {value}")
            if field.name in NOT_NEGATIVE and value is not None and value < 0.0:
                raise ValueError(f"{field.name}: expected at least 0, got {value}")

    @abstractmethod
    def steps(self, number: int) -> Iterator[Step]:
        """Yield the steps of the phase, which is the phase with this number of the protocol."""

    @property
    def deepest(self) -> float:
        """Greatest stated depth [m]; 0 if none is stated."""
        return 0.0

    @property
    def largest_force(self) -> float:
        """Greatest stated force [N]; 0 if none is stated."""
        return 0.0

    @property
    def highest(self) -> float:
        """Highest frequency of the motion [Hz]."""
        return 0.0


POSITIVE = (
    *("time", "speed", "ramp", "hold", "duration", "low", "high", "amplitude", "frequencies"),
    *("cycles", "repetitions", "max_depth"),
)
NOT_NEGATIVE = ("rest",)


@dataclass(frozen=True)
class Level(Phase):
    """A phase at a depth or at a contact force."""

    depth: float | None = None
    """Depth [m]; it may be negative, out of contact."""
    force: float | None = None
    """Contact force [N], > 0."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.depth is None) == (self.force is None):
            raise ValueError("expected either depth or force")
        if self.force is not None and self.force <= 0.0:
            raise ValueError(f"force: expected more than 0, got {self.force}")

    @property
    def by(self) -> Quantity:
        """Controlled quantity."""
        return "position" if self.force is None else "force"

    @property
    def value(self) -> float:
        """Depth [m] or contact force [N]."""
        value = self.depth if self.force is None else self.force
        assert value is not None
        return value

    @property
    def swing(self) -> float:
        """Amplitude about the value."""
        return 0.0

    @property
    def deepest(self) -> float:
        """Greatest depth [m]; 0 if a force is stated."""
        return 0.0 if self.depth is None else self.depth + self.swing

    @property
    def largest_force(self) -> float:
        """Greatest force [N]; 0 if a depth is stated."""
        return 0.0 if self.force is None else self.force + self.swing


@dataclass(frozen=True)
class Approach(Phase):
    """Move toward the specimen until the contact force reaches a value.

    The position at which it does is the contact point, from which later depths are measured.
    """

    force: float = 0.2
    """Contact force at which the approach ends [N], > 0."""
    speed: float = 2e-3
    """Speed [m/s], > 0."""
    max_depth: float | None = None
    """Position at which the trial ends if there was no contact [m], from the contact datum.
    Default: the depth of the trial."""
    kind: Literal["approach"] = "approach"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.force <= 0.0:
            raise ValueError(f"force: expected more than 0, got {self.force}")

    @property
    def deepest(self) -> float:
        """Position at which the approach ends [m]; 0 if it is that of the trial."""
        return self.max_depth or 0.0

    @property
    def largest_force(self) -> float:
        """Contact force at which the approach ends [N]."""
        return self.force

    def steps(self, number: int) -> Iterator[Step]:
        """Yield the approach."""
        yield Seek(number, "position", self.force, self.speed, self.max_depth)


@dataclass(frozen=True)
class Ramp(Level):
    """Move to a depth or a force, in a time or with a highest speed."""

    time: float | None = None
    """Duration [s], > 0."""
    speed: float | None = None
    """Highest speed [m/s or N/s], > 0."""
    kind: Literal["ramp"] = "ramp"

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.time is None) == (self.speed is None):
            raise ValueError("expected either time or speed")

    def steps(self, number: int) -> Iterator[Step]:
        """Yield the movement."""
        yield Move(number, self.by, self.value, self.time, self.speed)


@dataclass(frozen=True)
class Hold(Phase):
    """Hold the present position, or the present contact force."""

    duration: float = 10.0
    """Duration [s], > 0."""
    by: Quantity = "position"
    """What is held."""
    kind: Literal["hold"] = "hold"

    def steps(self, number: int) -> Iterator[Step]:
        """Yield the hold."""
        yield Stay(number, self.by, self.duration)


@dataclass(frozen=True)
class Preload(Level):
    """Move to a depth or a force and hold it, so that the specimen is in full contact."""

    ramp: float = 1.0
    """Duration of the movement [s], > 0."""
    hold: float = 5.0
    """Duration of the hold [s], > 0."""
    kind: Literal["preload"] = "preload"

    def steps(self, number: int) -> Iterator[Step]:
        """Yield movement and hold."""
        yield Move(number, self.by, self.value, self.ramp)
        yield Stay(number, self.by, self.hold)


@dataclass(frozen=True)
class RampHoldRelease(Level):
    """Ramp to a depth or a force, hold, ramp back, and rest; repeatedly."""

    ramp: float = 0.2
    """Duration of each ramp [s], > 0."""
    hold: float = 10.0
    """Duration of the hold [s], > 0."""
    rest: float = 0.0
    """Duration of the rest at the start position [s]."""
    repetitions: int = 1
    """Number of repetitions, > 0."""
    kind: Literal["ramp-hold-release"] = "ramp-hold-release"

    def steps(self, number: int) -> Iterator[Step]:
        """Yield the ramps, holds and rests."""
        for _ in range(self.repetitions):
            yield Move(number, self.by, self.value, self.ramp)
            yield Stay(number, self.by, self.hold)
            yield Move(number, "position", 0.0, self.ramp)
            if self.rest:
                yield Rest(number, "position", self.rest)


@dataclass(frozen=True)
class Staircase(Phase):
    """Ramp to several depths or forces, and hold each of them."""

    depths: tuple[float, ...] = ()
    """Depths [m]."""
    forces: tuple[float, ...] = ()
    """Contact forces [N], > 0."""
    ramp: float = 0.2
    """Duration of each ramp [s], > 0."""
    hold: float = 5.0
    """Duration of each hold [s], > 0."""
    kind: Literal["staircase"] = "staircase"

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.depths) == bool(self.forces):
            raise ValueError("expected either depths or forces")
        if any(force <= 0.0 for force in self.forces):
            raise ValueError(f"forces: expected more than 0, got {self.forces}")

    def steps(self, number: int) -> Iterator[Step]:
        """Yield the ramps and holds."""
        by: Quantity = "position" if self.depths else "force"
        for value in self.depths or self.forces:
            yield Move(number, by, value, self.ramp)
            yield Stay(number, by, self.hold)

    @property
    def deepest(self) -> float:
        """Greatest depth [m]."""
        return max(self.depths, default=0.0)

    @property
    def largest_force(self) -> float:
        """Greatest force [N]."""
        return max(self.forces, default=0.0)


@dataclass(frozen=True)
class Periodic(Level):
    """A phase that moves periodically about a depth or a force."""

    amplitude: float | None = None
    """Largest deviation [m, or N about a force], > 0. Default about a depth: 0.5 mm."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.force is None:
            return
        if self.amplitude is None:
            raise ValueError("amplitude: is missing: expected a force [N]")
        if not self.amplitude < self.force:
            raise ValueError(f"amplitude: expected less than force, got {self.amplitude}")

    @property
    def swing(self) -> float:
        """Largest deviation from the value."""
        return AMPLITUDE if self.amplitude is None else self.amplitude


@dataclass(frozen=True)
class Band(Periodic):
    """A phase whose motion has the frequencies of a band."""

    low: float = 0.1
    """Lowest frequency [Hz], > 0."""
    high: float = 10.0
    """Highest frequency [Hz], > low."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.low < self.high:
            raise ValueError(f"expected low < high, got {self.low} and {self.high}")

    @property
    def highest(self) -> float:
        """Highest frequency [Hz]."""
        return self.high


@dataclass(frozen=True)
class Cyclic(Periodic):
    """Sines of several frequencies about a depth or a force, one after the other."""

    frequencies: tuple[float, ...] = (1.0,)
    """Frequencies [Hz], > 0."""
    cycles: int = 8
    """Number of whole cycles of each frequency, > 0. One cycle more begins the motion, and one ends
    it."""
    kind: Literal["cyclic"] = "cyclic"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.frequencies:
            raise ValueError("frequencies: expected at least one")

    def steps(self, number: int) -> Iterator[Step]:
        """Yield the movement to the mean, and a step for each frequency."""
        yield Move(number, self.by, self.value, 0.5)
        for frequency in self.frequencies:
            tone = ((frequency, 1.0, 0.0),)
            time = (self.cycles + 2 * ONSET) / frequency
            yield Oscillate(number, self.by, self.value, self.swing, tone, time, ONSET / frequency)

    @property
    def highest(self) -> float:
        """Highest frequency [Hz]."""
        return max(self.frequencies)


@dataclass(frozen=True)
class Sweep(Band):
    """A sine about a depth or a force, whose frequency increases and decreases again."""

    duration: float = 30.0
    """Duration [s], > 0."""
    kind: Literal["sweep"] = "sweep"

    def steps(self, number: int) -> Iterator[Step]:
        """Yield the movement to the mean, and the sweep."""
        yield Move(number, self.by, self.value, 0.5)
        yield SweepFrequency(
            number, self.by, self.value, self.swing, self.low, self.high, self.duration
        )


@dataclass(frozen=True)
class Random(Band):
    """A random motion about a depth or a force, of a band of frequencies."""

    low: float = 0.2
    """Lowest frequency [Hz], > 0."""
    high: float = 5.0
    """Highest frequency [Hz], > low."""
    duration: float = 20.0
    """Duration [s], > 0."""
    seed: int = 0
    """Seed of the random phases."""
    kind: Literal["random"] = "random"

    def steps(self, number: int) -> Iterator[Step]:
        """Yield the movement to the mean, and the random motion."""
        yield Move(number, self.by, self.value, 0.5)
        generator = random.Random(self.seed)
        ratio = self.high / self.low
        sines = [
            (self.low * ratio ** (i / (TONES - 1)), generator.uniform(0.0, 2.0 * math.pi))
            for i in range(TONES)
        ]
        count = round(SAMPLES * self.high * self.duration)
        times = (i / (SAMPLES * self.high) for i in range(count + 1))
        peak = max(
            abs(sum(math.sin(2.0 * math.pi * frequency * t + phase) for frequency, phase in sines))
            for t in times
        )
        tones = tuple((frequency, 1.0 / peak, phase) for frequency, phase in sines)
        rise = min(1.0, 0.25 * self.duration)
        yield Oscillate(number, self.by, self.value, self.swing, tones, self.duration, rise)


@dataclass(frozen=True)
class Withdraw(Phase):
    """Move back to a depth, by default to the contact point, and rest there."""

    duration: float = 1.0
    """Duration of the rest [s], > 0."""
    depth: float = 0.0
    """Depth [m]; negative out of contact."""
    ramp: float = 0.5
    """Duration of the movement [s], > 0."""
    kind: Literal["rest"] = "rest"

    def steps(self, number: int) -> Iterator[Step]:
        """Yield movement and rest."""
        yield Move(number, "position", self.depth, self.ramp)
        yield Rest(number, "position", self.duration)

    @property
    def deepest(self) -> float:
        """Depth [m]."""
        return max(self.depth, 0.0)


AnyPhase = (
    Approach
    | Ramp
    | Hold
    | Preload
    | RampHoldRelease
    | Staircase
    | Cyclic
    | Sweep
    | Random
    | Withdraw
)
"""Types of phase that a protocol can have."""
