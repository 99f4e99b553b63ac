"""Simulated operators. Each one computes the intended motion of a person's hand during palpation.

A person acts on the handle through the impedance of the arm. The motion of the handle therefore
depends on the intended motion, the arm, and the admittance of the controller.

A poke consists of a movement into the specimen and a movement back. Both are minimum-jerk
movements [1]. The stiffness and the damping of the arm (`ARM`) are in the range measured at the
hand [2, 3]. Physiological tremor has frequencies of 8 to 12 Hz. At the tool of a surgeon, the
amplitude of the tremor is about 0.1 mm [4]. Here the tremor is the sum of three sines, each with
the amplitude `TREMOR_AMPLITUDE`. The following values are assumptions without a source. Depth and
timing vary by 10 to 15 % from one poke or cycle to the next. By default, the hand does not move
back to the start position after a poke (`WITHDRAWAL`). The first movement starts after the time
`REACTION`.

[1] T. Flash, N. Hogan, J. Neurosci. 5(7), 1985.
[2] F. A. Mussa-Ivaldi, N. Hogan, E. Bizzi, J. Neurosci. 5(10), 1985.
[3] T. Tsuji, P. G. Morasso, K. Goto, K. Ito, Biol. Cybern. 72, 1995.
[4] S. P. N. Singh, C. N. Riviere, Proc. IEEE Northeast Bioeng. Conf., 2002.
"""

from __future__ import annotations

import math
import random
from abc import ABC, abstractmethod
from math import cos, sin
from typing import NamedTuple

from drivers import new_tuple
from sim_backend.force_master import FreeHandle
from sim_backend.plant import Arm, Handle, Intention


class Hand(ABC):
    """Base class of simulated hands, which move the handle of the simulated rig.

    The hand is that of a simulated operator, or it follows a pointer such as a mouse.

    Attributes
    ----------
    handle
        The handle of the simulated rig; None before the rig is created.
    """

    handle: Handle | FreeHandle | None = None

    @abstractmethod
    def intention(self, t: float) -> Intention | None:
        """Return the intended motion of the hand at t [s] after the drives were enabled.

        The result is None if the hand does not hold the handle. t increases from one call to the
        next. When the drives are enabled again, t starts again at 0.
        """

    def feel(self, t: float, position: float, force: float) -> None:  # noqa: B027
        """Process the handle position [m] and the force [N] that the hand feels at t [s].

        t is the time since the drives were enabled. In this base class, the method does nothing. A
        subclass can override it, so that the intended motion depends on the felt force.
        """


ARM = Arm(stiffness=400.0, damping=12.0)
"""Default impedance of the arm."""
TREMOR_AMPLITUDE = 0.1e-3
"""Amplitude of each of the three tremor components of the intended motion [m]."""
MOVED = 0.35
"""Largest position of the handle, divided by the depth, while the operator's hand waits.

A hand that waits cannot move the handle farther. At a larger position, the rig has moved the
handle. A hand that waits is at 0.1 of the depth. Its tremor moves the handle by at most 0.1 mm.
This is less than a tenth of the smallest depth of the condition `mimic`.
"""
REACTION = 0.2
"""Time from the enabling of the drives to the first movement of the hand [s]."""
WITHDRAWAL = 0.5
"""Default mean intended position of the hand between two pokes, divided by the depth."""


class Stroke(NamedTuple):
    """Minimum-jerk movement of a hand from one position to another (Flash and Hogan, 1985)."""

    start: float
    """Time at which the movement starts [s]."""
    duration: float
    """Duration [s]."""
    distance: float
    """Final position minus start position [m]; negative for a movement out of the specimen."""

    @property
    def end(self) -> float:
        """Time at which the movement ends [s]."""
        return self.start + self.duration

    def at(self, t: float) -> tuple[float, float]:
        """Return the position relative to the start position [m], and the velocity [m/s].

        t is the time [s], t >= `start`. After the end of the movement, the velocity is zero.
        """
        share = min((t - self.start) / self.duration, 1.0)
        return (
            self.distance * share**3 * (10.0 - 15.0 * share + 6.0 * share**2),
            self.distance / self.duration * 30.0 * share**2 * (1.0 - share) ** 2,
        )


class Operator(Hand):
    """Base class of simulated operators who palpate to a given depth."""

    def __init__(self, depth: float, seed: int) -> None:
        if not 0.0 < depth < math.inf:
            raise ValueError(f"palpation depth must be positive, got {depth} m")
        self.depth = depth
        self.random = random.Random(f"{type(self).__name__} {seed}")
        self._tremor = [
            (2.0 * math.pi * self.random.uniform(8.0, 12.0), self.random.uniform(0.0, 2 * math.pi))
            for _ in range(3)
        ]

    @abstractmethod
    def movement(self, t: float) -> Intention:
        """Return the intended motion without tremor, at t [s] after the hand began to move.

        t increases from one call to the next. If the drives are disabled and enabled again, t
        starts again at 0.
        """

    def intention(self, t: float) -> Intention | None:
        """Return the intended motion including tremor, at t [s] after the drives were enabled."""
        if t < REACTION:
            return Intention(0.0, 0.0)
        t -= REACTION
        position, velocity = self.movement(t)
        onset, onset_rate = (t, 1.0) if t < 1.0 else (1.0, 0.0)
        scale = TREMOR_AMPLITUDE * onset
        for omega, phase in self._tremor:
            angle = omega * t + phase
            sine, cosine = sin(angle), cos(angle)
            position += scale * sine
            velocity += TREMOR_AMPLITUDE * (onset_rate * sine + onset * omega * cosine)
        return new_tuple(Intention, (position, velocity))


class FreePalpation(Operator):
    """Operator who palpates freely by pokes of about 1.2 s.

    A poke is a movement into the specimen, a short rest, a movement back, and a short rest.

    Parameters
    ----------
    depth
        Intended depth of the handle [m], > 0.
    seed
        Seed of the random variations of the motion.
    withdrawal
        Mean intended position of the hand between two pokes, divided by the depth.
    """

    def __init__(self, depth: float, seed: int, withdrawal: float = WITHDRAWAL) -> None:
        super().__init__(depth, seed)
        self._withdrawal = withdrawal
        self._stroke = Stroke(0.0, 0.0, 0.0)
        self._from = self._to = 0.0
        self._dwell = self._end = 0.0
        self._inwards = False

    def movement(self, t: float) -> Intention:
        """Return the intended motion without tremor, at t [s] after the hand began to move.

        The motion consists of minimum-jerk movements, with a short rest after each movement.
        """
        if t < self._stroke.start:  # the drives were enabled again
            self._to, self._inwards, self._end = 0.0, False, t
        while t >= self._end:
            self._next(self._end)
        travelled, velocity = self._stroke.at(t)
        return new_tuple(Intention, (self._from + travelled, velocity))

    def _next(self, start: float) -> None:
        """Plan the next movement, which begins at the time `start` [s].

        Movements into the specimen and movements back alternate.
        """
        self._inwards = not self._inwards
        self._from = self._to
        if self._inwards:
            self._to = self._reach() * self.random.gauss(1.0, 0.1)
        else:
            middle = self._withdrawal
            self._to = self.depth * self.random.uniform(middle - 0.15, middle + 0.15)
        duration = max(0.25, self.random.gauss(0.45, 0.06))
        self._dwell = max(0.0, self.random.gauss(0.15, 0.05))
        self._stroke = Stroke(start, duration, self._to - self._from)
        self._end = self._stroke.end + self._dwell

    def _reach(self) -> float:
        """Return the intended position at the end of the next movement into the specimen [m]."""
        return self.depth


class MimickedSine(Operator):
    """Operator who tracks a sine of constant frequency and amplitude, with the errors of a person.

    The amplitude and the phase of the intended motion vary slowly and randomly.

    Parameters
    ----------
    depth
        Intended depth of the handle [m], > 0.
    seed
        Seed of the random variations of the motion.
    frequency
        Frequency of the sine [Hz], > 0.
    count_in
        Time for which the operator waits at a small depth before the sine begins [s], >= 0.
    """

    def __init__(
        self, depth: float, seed: int, frequency: float = 1.0, count_in: float = 0.0
    ) -> None:
        super().__init__(depth, seed)
        self._frequency = frequency
        self._count_in = count_in
        self._amplitude_wander = self._wander(0.07)
        self._phase_wander = self._wander(0.3)

    def _wander(self, size: float) -> list[tuple[float, float, float]]:
        """Return the parameters of three slow sines, whose sum is a slow random variation.

        The parameters of each sine are a tuple of amplitude, angular frequency [rad/s] and phase
        [rad]. The amplitude of each sine is `size`. Frequency and phase are random.
        """
        return [
            (size, 2 * math.pi * self.random.uniform(0.1, 0.5), self.random.uniform(0, 2 * math.pi))
            for _ in range(3)
        ]

    def movement(self, t: float) -> Intention:
        """Return the intended motion without tremor, at t [s] after the hand began to move.

        First, the hand moves to a small depth and waits. Then it moves sinusoidally between the
        small depth and about the intended depth. The amplitude and the phase of this motion vary
        slowly and randomly.
        """
        light, light_rate = (t, 1.0) if t < 1.0 else (1.0, 0.0)
        t = max(t - self._count_in, 0.0)
        omega = 2.0 * math.pi * self._frequency
        phase, phase_rate = omega * t, omega
        for size, slow, offset in self._phase_wander:
            phase += size * (math.sin(slow * t + offset) - math.sin(offset))
            phase_rate += size * slow * math.cos(slow * t + offset)
        half, half_rate = 0.45 * self.depth, 0.0
        for size, slow, offset in self._amplitude_wander:
            half += 0.45 * self.depth * size * math.sin(slow * t + offset)
            half_rate += 0.45 * self.depth * size * slow * math.cos(slow * t + offset)
        lift = 1.0 - math.cos(phase)
        return Intention(
            0.1 * self.depth * light + half * lift,
            0.1 * self.depth * light_rate + half_rate * lift + half * phase_rate * math.sin(phase),
        )


class AttentiveOperator(MimickedSine):
    """Operator who can be used in each control condition, and who does not know the condition.

    The operator waits at a small depth for the time `count_in`, and then moves the hand
    sinusoidally, also in the condition `free`. If the rig moves the handle while the operator
    waits, the operator assumes the condition `autonomous` and releases the handle.
    """

    _released = False

    def intention(self, t: float) -> Intention | None:
        """Return the intended motion at t [s] after the drives were enabled.

        The result is None after the operator has released the handle.
        """
        waits = t < REACTION + self._count_in
        if waits and self.handle and self.handle.x > MOVED * self.depth:
            self._released = True
        return None if self._released else super().intention(t)
