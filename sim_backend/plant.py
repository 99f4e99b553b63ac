"""Dynamics of the telemanipulator: handle, slave in contact with a body, and force channels.

A force channel is a force sensor with its amplifier.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from drivers import Command
from sim_backend.body import Body
from sim_backend.force_master import ForceMaster, FreeHandle
from sim_backend.transmission import RIGID, Transmission

MAX_STEP = 1e-3
"""Longest integration step [s]. Half of this step gives the same readings of the sensors."""


@dataclass(frozen=True)
class PlantParameters:
    """Parameters of the drives and of the force channels (force sensors with amplifier).

    The defaults are typical laboratory values.
    """

    handle_bandwidth: float = 40.0
    """Bandwidth of the handle's velocity servo [Hz]. The hand's force does not disturb it."""
    slave_bandwidth: float = 80.0
    """Bandwidth of the proportional part of the slave's velocity servo [Hz]."""
    slave_integral: float = 25.0
    """Corner frequency of the integral part of the slave's velocity servo [Hz]."""
    slave_mass: float = 3.0
    """Moving mass of the slave [kg]."""
    master_force_lag: float = 1e-3
    """Time constant of the handle's force channel [s]."""
    contact_force_lag: float = 1e-3
    """Time constant of the contact force channel [s]."""
    transmission: Transmission = RIGID
    """Transmission between the slave's motor, with its encoder, and the tip."""

    @property
    def slave_compliance(self) -> float:
        """Position error of the slave in steady state per newton of constant load [m/N].

        The velocity servo of the slave has an integral part. A constant load therefore causes a
        constant position error.
        """
        corners = self.slave_bandwidth * self.slave_integral
        return 1.0 / (self.slave_mass * (2.0 * math.pi) ** 2 * corners)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name != "transmission" and not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")


class Handle:
    """The handle of the master. Its velocity servo is a first-order lag: x'' = w (u - x').

    u is the velocity command, and w is 2 pi times the bandwidth [Hz] of the servo. The attributes
    `x` and `v` are the position [m] and the velocity [m/s].
    """

    def __init__(self, bandwidth: float) -> None:
        self._rate = 2.0 * math.pi * bandwidth
        self.x = self.v = 0.0

    def advance(self, u: float, dt: float, arm: Arm, intended: Intention | None) -> None:
        """Advance the motion of the handle by the time `dt` [s].

        `u` is the velocity command [m/s], which is constant during this time. The equation of
        motion is solved exactly. The hand has no effect on the servo.
        """
        slip = self.v - u
        left = slip * math.exp(-self._rate * dt)
        self.x += u * dt + (slip - left) / self._rate
        self.v = u + left


class Slave:
    """The motor of the slave, which moves the tip.

    The attributes `x` and `v` are the position [m] and the velocity [m/s] of the motor. The
    velocity servo has a proportional part with gain K_p and an integral part with gain K_i. m is
    the moving mass, u the velocity command, and e the integral of the velocity error. The load
    l(x, x') is the force of the body on the tip plus the friction at the tip:

        m x'' = m (K_p (u - x') + K_i e) - l(x, x'),    e' = u - x'

    During an integration step, the force of the body depends only on displacement and velocity. The
    effect of the deformation in the past is updated at the end of the step.
    """

    def __init__(self, body: Body, parameters: PlantParameters) -> None:
        self._transmission = parameters.transmission
        self._played = 0.0
        self.palpate(body)
        self.x = self.v = 0.0
        self.command = 0.0
        """Last velocity command [m/s]."""
        self.push: float | None = None
        """Force of the motor [N] in place of that of the velocity servo; None for the servo."""
        self._error = 0.0
        self._mass = parameters.slave_mass
        self._proportional = 2.0 * math.pi * parameters.slave_bandwidth
        self._integral = self._proportional * 2.0 * math.pi * parameters.slave_integral

    def palpate(self, body: Body) -> None:
        """Replace the palpated body by `body`, in the state before its first contact."""
        self._body, self._state = body, body.initial
        self.law = body.law(body.initial)
        """Present contact force of the body, as a function of displacement and velocity."""
        self._tip = self.law.compressed(self._played, self._transmission.compliance)

    @property
    def force(self) -> float:
        """Force of the body on the tip [N]."""
        return self._transmission.tip_force(self.law, self._played, self._tip, self.x, self.v)

    def load(self, x: float, v: float) -> float:
        """Return the load on the motor [N] at the motor position x [m] and velocity v [m/s].

        The load is the force of the body on the tip plus the friction at the tip. The motor is
        assumed to move from its present position to x without a reversal of direction.
        """
        return self._transmission.load(self.law, self._played, self._tip, x, v)

    @property
    def motor_force(self) -> float:
        """Force of the motor on the moving mass of the slave [N]."""
        if self.push is not None:
            return self.push
        return self._mass * (
            self._proportional * (self.command - self.v) + self._integral * self._error
        )

    def move_to(self, x: float, v: float) -> None:
        """Set the position x [m] and the velocity v [m/s] of the motor.

        The motor is assumed to move from its last position to x without a reversal of direction.
        """
        self.x, self.v = x, v
        self._played = self._transmission.play(self._played, x)
        self._tip = self.law.compressed(self._played, self._transmission.compliance)

    def advance(self, u: float, h: float) -> None:
        """Advance the motion of the slave by one Runge-Kutta step of the length `h` [s].

        `u` is the velocity command [m/s], which is constant during the step.
        """
        self.command = u
        x, v1, error, played, tip = self.x, self.v, self._error, self._played, self._tip
        gain, integral, mass = self._proportional, self._integral, self._mass
        push = 0.0
        if self.push is not None:
            gain = integral = error = self._error = 0.0
            push = self.push / mass
        law, load, half = self.law, self._transmission.load, 0.5 * h
        a1 = gain * (u - v1) + integral * error - load(law, played, tip, x, v1) / mass + push
        x2, v2, e2 = x + half * v1, v1 + half * a1, error + half * (u - v1)
        a2 = gain * (u - v2) + integral * e2 - load(law, played, tip, x2, v2) / mass + push
        x3, v3, e3 = x + half * v2, v1 + half * a2, error + half * (u - v2)
        a3 = gain * (u - v3) + integral * e3 - load(law, played, tip, x3, v3) / mass + push
        x4, v4, e4 = x + h * v3, v1 + h * a3, error + h * (u - v3)
        a4 = gain * (u - v4) + integral * e4 - load(law, played, tip, x4, v4) / mass + push
        travel = h / 6.0 * (v1 + 2.0 * (v2 + v3) + v4)
        self.move_to(x + travel, v1 + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4))
        self._error = error + u * h - travel if self.push is None else 0.0
        self._state = self._body.advanced(self._state, law.surface(self._tip), h)
        self.law = self._body.law(self._state)
        if self.law is not law:  # a body that depends on the past pushes the tip
            self._tip = self.law.compressed(self._played, self._transmission.compliance)


class ForceChannel:
    """A force sensor with amplifier. Its output y is a first-order lag: tau y' = f - y.

    f is the force on the sensor [N]. The attribute `y` is the output [N]. The parameter `lag` is
    the time constant tau [s].
    """

    def __init__(self, lag: float) -> None:
        self._lag = lag
        self._force = self.y = 0.0

    def advance(self, force: float, dt: float) -> None:
        """Advance the output `y` of the force sensor by the time `dt` [s].

        During this time, the force on the sensor changes linearly from its last value to `force`
        [N]. The equation of the lag is solved exactly.
        """
        behind = (force - self._force) / dt * self._lag
        decay = math.exp(-dt / self._lag)
        self.y = force - behind + (self.y - self._force + behind) * decay
        self._force = force


class Arm(NamedTuple):
    """Spring and damper (the operator's arm) between the intended hand position and the handle."""

    stiffness: float
    """Stiffness [N/m]."""
    damping: float
    """Damping [N s/m]."""

    def force(self, intended: Intention, handle: Handle | FreeHandle) -> float:
        """Return the force of the hand on the handle [N] for an intended motion of the hand."""
        return self.stiffness * (intended.position - handle.x) + self.damping * (
            intended.velocity - handle.v
        )


class Intention(NamedTuple):
    """Position and velocity that the operator intends for the hand, at one time."""

    position: float
    """Intended position [m]."""
    velocity: float
    """Intended velocity [m/s]."""


UNATTENDED = Arm(0.0, 0.0)
"""Arm that exerts no force, because nobody holds the handle."""
AT_REST = Intention(0.0, 0.0)


class Plant:
    """Simulation of the telemanipulator and its environment.

    Parameters
    ----------
    body
        The environment (palpated body), such as a cube.
    parameters
        Parameters of drives and force channels (force sensors with amplifier).
    arm
        Impedance of the operator's arm; `UNATTENDED` if nobody holds the handle.
    max_step
        Longest integration step [s].
    master
        Force-commanded master; None for a master with a velocity servo.

    Raises
    ------
    ValueError
        `max_step` is not positive.
    """

    def __init__(
        self,
        body: Body,
        parameters: PlantParameters,
        arm: Arm = UNATTENDED,
        max_step: float = MAX_STEP,
        master: ForceMaster | None = None,
    ) -> None:
        if not 0.0 < max_step < math.inf:
            raise ValueError(f"max_step must be positive, got {max_step} s")
        self.handle: Handle | FreeHandle = Handle(parameters.handle_bandwidth)
        if master:
            self.handle = FreeHandle(master.mass, master.friction)
        self.slave = Slave(body, parameters)
        self.master_force = ForceChannel(parameters.master_force_lag)
        self.contact_force = ForceChannel(parameters.contact_force_lag)
        self._arm = arm
        self._max_step = max_step

    def advance(self, dt: float, command: Command, intended: Intention | None = AT_REST) -> None:
        """Advance the simulation by `dt` [s].

        Parameters
        ----------
        dt
            Time step [s].
        command
            Velocity commands of handle and slave, constant over the step.
        intended
            Intended position and velocity of the operator's hand at the end of the step; None if
            the hand does not hold the handle.
        """
        self.handle.advance(command.master_velocity, dt, self._arm, intended)
        hand = self._arm.force(intended, self.handle) if intended else 0.0
        self.master_force.advance(hand, dt)
        steps = max(1, math.ceil(dt / self._max_step - 1e-6))
        for _ in range(steps):
            self.slave.advance(command.slave_velocity, dt / steps)
            self.contact_force.advance(self.slave.force, dt / steps)
