"""Soft limits, which reduce the desired command but permit motion away from a limit."""

from __future__ import annotations

import math

from drivers import STANDSTILL, Command, Measurement, new_tuple
from teleop.safety.limits import Limits
from teleop.safety.state import Supervision

FLAGS = {"velocity": 1, "acceleration": 2, "position": 4, "force": 8}
"""Flag of each soft limit. The sum of the flags shows which limits changed a command."""
VELOCITY, ACCELERATION, POSITION, FORCE = FLAGS.values()

APPROACH_TIME = 0.05
"""Shortest time in which the expected contact force may reach the soft force limit [s].

This time is used only by `limit_separately`.
"""
CONTACT = 0.1
"""Contact force below which the direction of the force is treated as unknown [N]."""


def ramp_down(command: Command, dt: float, limits: Limits) -> Command:
    """Return the next command of a ramp that brings both velocities to zero."""
    return limit_acceleration(STANDSTILL, command, dt, limits)


def limit_acceleration(wanted: Command, last: Command, dt: float, limits: Limits) -> Command:
    """Limit the change of the velocities of master and slave since the previous tick.

    The result is the command nearest to the wanted command whose accelerations do not exceed the
    limits of master and slave.
    """
    (master, slave), (last_master, last_slave) = wanted, last
    step = limits.max_master_acceleration * dt
    low, high = last_master - step, last_master + step
    master = low if master < low else high if master > high else master
    step = limits.max_acceleration * dt
    low, high = last_slave - step, last_slave + step
    slave = low if slave < low else high if slave > high else slave
    return new_tuple(Command, (master, slave))


def limit_command(
    desired: Command,
    measurement: Measurement,
    active: float,
    dt: float,
    state: Supervision,
    limits: Limits,
    stiffness: float | None = None,
) -> tuple[Command, int]:
    """Apply the soft limits of velocity, position, force and acceleration to the desired command.

    If `stiffness` is None, the velocities of master and slave are reduced by the same factor. The
    operator then feels the limits of the slave. If `stiffness` is given, the velocities are limited
    separately, see `limit_separately`. In both cases, the accelerations of master and slave are
    limited afterwards, separately.

    When the slave moves toward a soft position limit, its speed is at most v = sqrt(a d). d is the
    distance to the limit, and a is the largest permitted acceleration. The slave can then stop at
    the limit with the deceleration v^2 / (2 d) = a / 2, which is half of the permitted value. If
    the contact force exceeds the soft force limit, the slave does not press further.

    The velocity limits increase from zero to their values in the first `Limits.start_ramp` seconds
    of `active`, the time since the drives were armed [s]. The returned flags are the sum of
    `VELOCITY`, `ACCELERATION`, `POSITION` and `FORCE`, for the limits that changed the command.
    """
    ramp = min(active / limits.start_ramp, 1.0)
    if stiffness is None:
        wanted, flags = limit_together(desired, measurement, ramp, limits)
    else:
        wanted, flags = limit_separately(desired, measurement, ramp, stiffness, limits)
    command = limit_acceleration(wanted, state.applied, dt, limits)
    if command != wanted:
        flags |= ACCELERATION
    return command, flags


def limit_together(
    desired: Command, measurement: Measurement, ramp: float, limits: Limits
) -> tuple[Command, int]:
    """Reduce the velocities of master and slave by the same factor, to comply with soft limits.

    These are the soft limits of velocity, position and contact force, but not of acceleration.
    """
    master, slave = desired
    factor, flags, speed = 1.0, 0, abs(slave)
    fastest, fastest_master = limits.max_velocity * ramp, limits.max_master_velocity * ramp
    if speed > fastest:
        factor, flags = fastest / speed, VELOCITY
    if abs(master) * factor > fastest_master:
        factor, flags = fastest_master / abs(master), VELOCITY
    braking = braking_speed(slave, measurement, limits)
    if speed * factor > braking:
        factor = braking / speed
        flags |= POSITION
    f = measurement.contact_force
    if slave * f > 0.0 and abs(f) > limits.soft_force:
        factor = 0.0
        flags |= FORCE
    return Command(master * factor, slave * factor) if factor < 1.0 else desired, flags


def limit_separately(
    desired: Command, measurement: Measurement, ramp: float, stiffness: float, limits: Limits
) -> tuple[Command, int]:
    """Limit the velocities of master and slave separately, to comply with the soft limits.

    The velocity limit of the master applies only to the master. The limits of velocity, position
    and force of the slave apply only to the slave. If they reduce the velocity of the slave, the
    hand feels this only through the communication channel between master and slave.

    When the slave presses further into the palpated body, its speed is at most (soft_force - |f|) /
    (stiffness T), with the contact force f and the time T = `APPROACH_TIME`. The expected force
    then does not exceed the soft limit within the time T.
    """
    master, slave = desired
    flags, speed = 0, abs(slave)
    fastest, fastest_master = limits.max_velocity * ramp, limits.max_master_velocity * ramp
    if abs(master) > fastest_master:
        master, flags = math.copysign(fastest_master, master), VELOCITY
    if speed > fastest:
        speed, flags = fastest, VELOCITY
    braking = braking_speed(slave, measurement, limits)
    if speed > braking:
        speed, flags = braking, flags | POSITION
    f = measurement.contact_force
    x = measurement.slave_position
    if slave * f > 0.0 or (abs(f) < CONTACT and slave * x >= 0.0):
        left = limits.soft_force - abs(f)
        if left < 0.0:
            left = 0.0
        if speed * stiffness * APPROACH_TIME > left:
            speed, flags = left / (stiffness * APPROACH_TIME), flags | FORCE
        elif not left:
            speed, flags = 0.0, flags | FORCE
    if not flags:
        return desired, 0
    return new_tuple(Command, (master, math.copysign(speed, slave))), flags


def braking_speed(slave: float, measurement: Measurement, limits: Limits) -> float:
    """Return the largest permitted speed of the slave toward its soft position limit [m/s].

    At this speed, the slave can stop at the limit with half of the largest acceleration. The speed
    is 0 if the slave is beyond the limit.
    """
    low, high = limits.soft_position
    x = measurement.slave_position
    distance = high - x if slave > 0.0 else x - low
    return math.sqrt(limits.max_acceleration * distance) if distance > 0.0 else 0.0
