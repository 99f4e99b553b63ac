"""Control condition of a protocol: perform its steps one after another, without a hand.

The condition computes a desired velocity of the slave, and from it the force with which the virtual
mass of the admittance has this velocity after a tick. Let r be the position of the encoder at
which the tip of the slave has its reference, and x the position of the encoder. Then the velocity
is

    v = r' + g (r - x),                                                                       (1)

so that an error of the position decays with the rate g. Lost motion and compliance between encoder
and tip are compensated as far as they are known (`tip_position`). If the contact force f has the
reference q,

    v = (q' + w (q - f)) / k,                                                                 (2)

where k is the stiffness that the slave has felt. The loop gain of (2) is w k_true / (k s). With a
total lag T of the loop (in a hold with that of an average), w is 1 / (4 T): if the true stiffness
is twice the felt one, the phase margin is 61 degrees, and the gain margin is pi. (A loop gain c / s
with a delay T has the phase margin pi / 2 - c T, and oscillates from c T = pi / 2 on.) When the
force has to change its direction, most of the lost motion is crossed with the rate g.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import ConfigDict, Discriminator
from pydantic.dataclasses import dataclass

from drivers import Measurement
from estimation.filters import Play
from teleop.control.admittance import AdmittanceParameters
from teleop.control.conditions import Condition, IntendedMotion
from teleop.control.phases import AnyPhase, Move, Reference, Seek, Stay, Step
from teleop.control.tip_position import TipPosition

FOLLOWING = 30.0
"""Rate g with which an error of the position decays [1/s]."""
CROSSING = 150.0
"""Angular frequency of the filter with which the lost motion is crossed [rad/s]."""
CROSSED = 0.8
"""Part of the lost motion that is crossed at once when the force has to change its direction."""
LAG = 0.02
"""Longest lag of the contact force and of the drive with which the force is controlled [s]."""
STIFF = 50e3
"""Stiffness that is assumed until the slave has felt that of the specimen [N/m]."""
MEMORY = 0.3
"""Time constant of the averages from which the stiffness is computed [s]."""
LEAST_TRAVEL = 5e-6
"""Standard deviation of the position from which on the stiffness is computed [m]; at least three
steps of the encoder."""
TOUCHES = 3
"""Number of successive samples with the contact force that end an approach: noise may reach it."""
REACHED, LOST, LOST_TIME = 0.7, 0.3, 0.2
"""Shares of the reference from which on the contact force was reached, and below which it is lost
after this time [s]."""
IN_AIR = 5.0
"""Average force, in its standard deviations by noise, below which the slave may be in air."""
LEAST_CONTACT = 1e-3
"""Average force below which the slave may be in air [N]."""
SECANT = 1.5
"""First felt stiffness after an approach, relative to the secant of the contact force."""
IN_CONTACT = 9.0
"""Variance of the force, relative to that of its noise, from which on the slave is in contact."""
AVERAGING = 0.05
"""Time constant of the average of the force with which the force is held [s]."""
HELD = 0.01
"""Error of the average force, relative to its reference, below which the average is controlled."""
CROSSINGS = 8
"""Number of crossings of the reference force within `CROSSING_TIME` that are an oscillation."""
NOISES = 6.0
"""Smallest crossing, relative to the mean size of the noise."""
CROSSING_TIME = 2.0
"""Time in which crossings are counted [s]."""
CROSSING_SIZE = 0.15
"""Deviation from the reference force that counts as a crossing, relative to it."""


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class ProtocolSettings:
    """A protocol: a list of phases that the slave performs.

    Raises
    ------
    ValueError
        There is no phase.
    """

    phases: tuple[Annotated[AnyPhase, Discriminator("kind")], ...]
    """Phases in their order."""
    name: str = ""
    """Name of the protocol."""
    description: str = ""
    """What the protocol is for."""

    def __post_init__(self) -> None:
        if not self.phases:
            raise ValueError("phases: expected at least one")

    @property
    def steps(self) -> tuple[Step, ...]:
        """The steps of all phases, in their order."""
        numbered = enumerate(self.phases, start=1)
        return tuple(step for number, phase in numbered for step in phase.steps(number))

    @property
    def deepest(self) -> float:
        """Greatest stated depth [m]; 0 if no phase states one."""
        return max((phase.deepest for phase in self.phases), default=0.0)

    @property
    def largest_force(self) -> float:
        """Greatest stated contact force [N]; 0 if no phase states one."""
        return max((phase.largest_force for phase in self.phases), default=0.0)

    @property
    def highest(self) -> float:
        """Highest frequency of the motion [Hz]; 0 without a periodic motion."""
        return max((phase.highest for phase in self.phases), default=0.0)

    @property
    def longest(self) -> float:
        """Longest duration of the protocol [s]: each movement is assumed to need its whole way."""
        depths = [step.goal for step in self.steps if isinstance(step, Move)]
        least = min((one for one in depths), default=0.0)
        ends = {"position": (min(least, 0.0), self.deepest), "force": (0.0, self.largest_force)}
        return sum(max(map(step.duration, ends[step.by])) for step in self.steps)


class Protocol(Condition):
    """Perform the steps of a protocol, by position or by contact force."""

    instruction = "the controller performs a protocol; leave the handle free"
    moved_by = "injector"

    def __init__(self, settings: ProtocolSettings) -> None:
        self.settings = settings
        self.finished, self._index, self._reason = False, -1, ""

    def prepare(self, motion: IntendedMotion) -> None:
        """Begin with the first step."""
        self._steps = self.settings.steps
        self._mass = MassVelocity(motion.admittance)
        self._scale = motion.scale
        self._depth = motion.depth
        known = motion.transmission
        self._lost, self._compliance = known.lost_motion, known.compliance
        self._offset = Offset(self._lost)
        self._deadband = 2.0 * motion.resolution
        self._play = Play(self._lost)
        self._felt = FeltStiffness(max(LEAST_TRAVEL, 3.0 * motion.resolution))
        self._crossings = Crossings()
        self._index = -1
        self._touching = 0
        """Number of successive samples of an approach with the contact force."""
        self._held = math.inf
        """Latest time at which the contact force was near its reference [s]."""
        self._zero = 0.0
        """Position of the tip at the contact point [m]."""
        self._time = self._begin = 0.0
        self._by, self._value, self._start = "position", math.nan, math.nan
        self.phase = math.nan
        self.finished, self._reason = False, ""

    @property
    def ending(self) -> str:  # type: ignore[override]
        """Reason why the protocol is not complete; empty if it is."""
        if self.finished or self._index < 0:
            return self._reason
        return f"the trial ended in step {self._index + 1} of {len(self._steps)} of the protocol"

    def motion_texts(self, motion: IntendedMotion) -> dict[str, str]:
        """Return the name of the protocol, and the number of its steps."""
        count = len(self.settings.steps)
        return super().motion_texts(motion) | {"protocol": f"{self.settings.name}, {count} steps"}

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force [N] with which the slave performs the present step."""
        x, f = measurement.slave_position, measurement.contact_force
        played = self._play.update(x)
        tip = played - self._compliance * f
        dt = t - self._time
        if dt < 0.0:
            self._end("the drives were armed again: a protocol is not continued")
        self._time = t
        if self.finished:
            return self._mass.force(0.0, max(dt, 0.0))
        if self._index < 0:
            self._next(t, tip, f)
        self._felt.update(tip, f, dt)
        if self._over(self._steps[self._index], t, tip, f):
            self._next(t, tip, f)
        if self.finished:
            return self._mass.force(0.0, dt)
        step = self._steps[self._index]
        value, rate = step.reference(t - self._begin, self._start)
        self._value = value
        if step.by == "position":
            r = self._zero + value
            offset = self._offset.update(r, dt)
            stretch = self._compliance * self._felt.force
            error = r + offset.value + stretch - x
            # an error within the resolution would make the drive change its direction at each tick
            beyond = math.copysign(max(abs(error) - self._deadband, 0.0), error)
            velocity = rate + offset.rate + FOLLOWING * beyond
        else:
            lag = LAG + 2.0 * dt
            error = value - self._felt.force
            if isinstance(step, Stay) and abs(error) < HELD * value:  # less noise
                velocity = error / (4.0 * (lag + AVERAGING)) / self._felt.stiffness
            else:
                velocity = (rate + (value - f) / (4.0 * lag)) / self._felt.stiffness
                # nearly to the other side of the lost motion, whose width is not known exactly
                side = math.copysign(CROSSED * self._lost, rate or error)
                if (x - played - side) * side < 0.0:
                    velocity += FOLLOWING * (side - (x - played))
            self._check_force(step, t, tip, f, value)
        return self._mass.force(velocity / self._scale, dt)

    def _check_force(self, step: Step, t: float, tip: float, f: float, value: float) -> None:
        """End the protocol if the contact force oscillates or is lost, or the tip is too deep."""
        # a sine of the force crosses its reference because of the lag of the control
        if isinstance(step, Move | Stay) and self._crossings.update(t, f, value):
            self._end("the control of the contact force oscillates")
        if self._felt.force > REACHED * value:
            self._held = t
        elif self._felt.force < LOST * value and t - self._held > LOST_TIME:
            self._end(f"the contact force was lost at {1e3 * tip:.3g} mm")
        if tip > self._depth:
            self._end(
                f"the tip is deeper than the depth of the trial, {1e3 * self._depth:.4g} mm, "
                f"before the contact force is {value:.3g} N"
            )

    def _over(self, step: Step, t: float, tip: float, f: float) -> bool:
        """Return whether a step has ended; end the protocol if an approach found no contact."""
        late = t - self._begin >= step.duration(self._start)
        if not isinstance(step, Seek):
            return late
        deepest = self._depth if step.deepest is None else step.deepest
        self._touching = self._touching + 1 if f >= step.force else 0
        if self._touching == TOUCHES:
            self._zero = tip
            self._felt.touched(tip, f)
            return True
        if late or tip >= deepest:
            self._end(
                f"approach: the contact force has not reached {step.force:g} N at "
                f"{1e3 * tip:.3g} mm"
            )
        elif self._felt.force < -step.force:
            self._end(f"approach: the contact force is negative, {self._felt.force:.3g} N")
        return False

    def _next(self, t: float, tip: float, f: float) -> None:
        """Begin the next step, from the last reference if the controlled quantity is the same."""
        self._index += 1
        if self._index == len(self._steps):
            self._end("")
            return
        last = self._by if self._index else ""
        step = self._steps[self._index]
        kept = last == step.by and not self._after_approach
        if isinstance(step, Seek):  # its depths are measured from the contact datum
            self._zero, self._touching, kept = 0.0, 0, False
        force = f if self._after_approach else self._felt.force
        present = tip - self._zero if step.by == "position" else force
        self._start = self._value if kept else present
        self._by, self._begin, self.phase = step.by, t, float(self._index)
        self._crossings, self._held = Crossings(), math.inf

    @property
    def _after_approach(self) -> bool:
        """Whether the previous step was an approach, which moves the contact point."""
        return self._index > 0 and self._steps[self._index - 1].kind == "approach"

    def _end(self, reason: str) -> None:
        """End the protocol, for a reason if it is not complete."""
        self.finished, self._reason = True, self._reason or reason


class MassVelocity:
    """Computes the force that gives the virtual mass of the admittance a velocity after a tick."""

    def __init__(self, admittance: AdmittanceParameters) -> None:
        self._admittance = admittance
        self._velocity = self._position = 0.0

    def force(self, velocity: float, dt: float) -> float:
        """Return the force [N] for the velocity [m/s] after the time `dt` [s].

        m v' + d v + c x = F is solved exactly for a constant force, as in the admittance. The
        force of the spring is that in the middle of the tick.
        """
        m, d, c = self._admittance.mass, self._admittance.damping, self._admittance.stiffness
        before, self._velocity = self._velocity, velocity
        travel = 0.5 * (before + velocity) * dt
        middle = self._position + 0.5 * travel
        self._position += travel
        if dt <= 0.0:
            return d * velocity + c * middle
        decay = math.exp(-d * dt / m)
        return d * (velocity - before * decay) / (1.0 - decay) + c * middle


class Offset:
    """Difference between encoder and tip in the lost motion, as the encoder should cross it.

    The difference of `TipPosition` is filtered, so that the drive can follow: a critically damped
    filter does not overshoot.

    Parameters
    ----------
    lost_motion
        Half width of the play between encoder and tip [m].
    """

    def __init__(self, lost_motion: float) -> None:
        self._encoder = TipPosition(lost_motion)
        self._value = self._rate = 0.0

    def update(self, tip: float, dt: float) -> Reference:
        """Return the offset and its rate for a reference of the tip [m]."""
        goal = self._encoder.goal(tip, 0.0, 0.0).position - tip
        w = min(CROSSING, 0.3 / dt) if dt > 0.0 else 0.0
        self._rate += (w * w * (goal - self._value) - 2.0 * w * self._rate) * dt
        self._value += self._rate * dt
        return Reference(self._value, self._rate)


class FeltStiffness:
    """Stiffness that the slave feels: the recent change of the force, by that of the position.

    It is the ratio of the two standard deviations in contact. Unlike the slope of a regression, it
    does not become smaller if the force has a lag, or noise: too small a stiffness would make the
    control of the force unstable. It increases at once, and decreases slowly.

    Parameters
    ----------
    least_travel
        Standard deviation of the positions from which on the ratio is used [m].
    """

    def __init__(self, least_travel: float) -> None:
        self._least = least_travel**2
        self.stiffness = STIFF
        """Stiffness [N/m]; `STIFF` before the slave has moved in contact."""
        self.force = 0.0
        """Average of the contact force [N]."""
        self._is_felt = False
        self._air = math.nan
        """Latest position in air [m]."""
        self._x = math.nan
        self._f = self._xx = self._ff = self._last = self._noise = 0.0

    def update(self, x: float, f: float, dt: float) -> None:
        """Process a sample: position [m] and contact force [N], and the time since the last [s]."""
        if math.isnan(self._x):
            self._x, self._f, self._last, self.force = x, f, f, f
            return
        self.force += (f - self.force) * min(dt / AVERAGING, 1.0)
        share = min(dt / MEMORY, 1.0)
        dx, df, change = x - self._x, f - self._f, f - self._last
        self._x += share * dx
        self._f += share * df
        self._last = f
        by_noise = math.sqrt(self._noise * dt / (2.0 * AVERAGING))
        if self.force < IN_AIR * by_noise + LEAST_CONTACT:  # the travel in air shows no stiffness
            self._x, self._f, self._xx, self._ff = x, f, 0.0, 0.0
            self._air = x
        self._xx += share * ((1.0 - share) * dx * dx - self._xx)
        self._ff += share * ((1.0 - share) * df * df - self._ff)
        self._noise += share * (0.5 * change * change - self._noise)
        if self._xx > self._least and self._ff > IN_CONTACT * self._noise:
            found = math.sqrt(self._ff / self._xx)
            slower = share if self._is_felt and found < self.stiffness else 1.0
            self.stiffness += slower * (found - self.stiffness)
            self._is_felt = True

    def touched(self, x: float, f: float) -> None:
        """Use the secant of the contact force at the end of an approach, if nothing is felt yet."""
        way = x - self._air
        if not self._is_felt and way * way > 4.0 * self._least:
            self.stiffness = SECANT * f / way


class Crossings:
    """Counts how often the contact force crosses its reference by more than a part of it.

    A crossing must be larger than the noise, which the successive differences of the force show.
    """

    def __init__(self) -> None:
        self._side = 0
        self._times: list[float] = []
        self._last, self._noise = math.nan, 0.0

    def update(self, t: float, force: float, reference: float) -> bool:
        """Return whether the force oscillates about its reference."""
        if not math.isnan(self._last):
            self._noise += 0.01 * (abs(force - self._last) - self._noise)
        self._last = force
        size = max(CROSSING_SIZE * abs(reference), NOISES * self._noise)
        side = (force > reference + size) - (force < reference - size)
        if side and side != self._side:
            if self._side:
                self._times = [one for one in self._times if t - one < CROSSING_TIME] + [t]
            self._side = side
        return len(self._times) >= CROSSINGS
