"""Soft limits, which reduce the desired command but permit motion away from a limit."""

from __future__ import annotations

import math

from drivers import STANDSTILL, Command, Measurement, new_tuple
from teleop.safety.limits import Limits
from teleop.safety.state import Supervision

VELOCITY, ACCELERATION, POSITION, FORCE = 1, 2, 4, 8
"""Flag of each soft limit. The sum of the flags shows which limits reduced a command."""

APPROACH_TIME = 0.05
"""Shortest time in which the expected contact force may reach the soft limit [s].

This time is used only if the limits act on master and slave separately.
"""
CONTACT = 0.1
"""Contact force below which the direction of the force is treated as unknown [N]."""


def ramp_down(command: Command, dt: float, limits: Limits) -> Command:
    """Return the next command of a ramp that decreases both velocities to zero.

    Parameters
    ----------
    command
        Command of the previous tick.
    dt
        Time since the previous tick [s].
    limits
        Limits of the rig. Only the largest accelerations of master and slave are used.
    """
    return limit_acceleration(STANDSTILL, command, dt, limits)


def limit_acceleration(wanted: Command, last: Command, dt: float, limits: Limits) -> Command:
    """Return the permitted command that is nearest to the wanted command.

    A command is permitted if the accelerations of master and slave do not exceed their limits.

    Parameters
    ----------
    wanted
        Wanted command.
    last
        Command of the previous tick.
    dt
        Time since the previous tick [s].
    limits
        Limits of the rig. Only the largest accelerations of master and slave are used.
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
    """Apply the soft limits to the desired command.

    If `stiffness` is None, the velocities of master and slave are reduced by the same factor. The
    operator then feels the limits of the slave. If `stiffness` is given, see `limit_separately`.
    After that, the accelerations of master and slave are limited independently of each other.

    When the slave moves towards a soft position limit, its speed is at most sqrt(a d). d is the
    distance to the limit, and a is the largest acceleration. A deceleration of a / 2 can then stop
    the slave at the limit. If the contact force exceeds the soft force limit, the slave does not
    press further.

    Parameters
    ----------
    desired
        Command of the control condition.
    measurement
        Measurement of this tick.
    active
        Time since the drives were armed [s].
    dt
        Time since the previous tick [s].
    state
        State of the supervisor after the previous tick.
    limits
        Limits of rig and channels.
    stiffness
        Expected slope of the contact force against the position of the slave [N/m]. If it is None,
        all soft limits except the acceleration limits act on master and slave together.

    Returns
    -------
    command
        Command that the soft limits allow.
    flags
        Sum of the flags of the soft limits that reduced the command.
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
    """Reduce the velocities of master and slave by the same factor; see `limit_command`."""
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
    """Limit the velocities of master and slave independently of each other.

    The velocity limit of the master applies only to the master. All other limits apply only to the
    slave. The hand feels the limits of the slave only through the communication channel, with its
    delay.

    When the slave moves into the contact, its speed is at most
    (soft_force - |f|) / (stiffness times `APPROACH_TIME`), where f is the contact force. The
    expected force then does not exceed the soft limit within `APPROACH_TIME`.
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
    """Return the largest speed [m/s] at which the slave can stop before its position limit."""
    low, high = limits.soft_position
    x = measurement.slave_position
    distance = high - x if slave > 0.0 else x - low
    return math.sqrt(limits.max_acceleration * distance) if distance > 0.0 else 0.0
