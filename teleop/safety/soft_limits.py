"""Soft limits: they reduce the desired command; motion away from a limit remains possible."""

from __future__ import annotations

import math

from drivers import STANDSTILL, Command, Measurement
from teleop.safety.limits import Limits
from teleop.safety.state import Supervision

VELOCITY, ACCELERATION, POSITION, FORCE = 1, 2, 4, 8
"""Flag of each soft limit. The sum of flags states which limits reduced a command."""


def ramp_down(command: Command, dt: float, limits: Limits) -> Command:
    """Return the next command of a ramp on which both velocities decrease to zero.

    Parameters
    ----------
    command
        Command of the previous tick.
    dt
        Time since the previous tick [s].
    limits
        Limits, of which the two greatest accelerations are used.
    """
    return limit_acceleration(STANDSTILL, command, dt, limits)


def limit_acceleration(wanted: Command, last: Command, dt: float, limits: Limits) -> Command:
    """Return the command nearest to the wanted command that the greatest accelerations allow.

    Parameters
    ----------
    wanted
        Wanted command.
    last
        Command of the previous tick.
    dt
        Time since the previous tick [s].
    limits
        Limits, of which the two greatest accelerations are used.
    """
    master, slave = limits.max_master_acceleration * dt, limits.max_acceleration * dt
    return Command(
        min(max(wanted[0], last[0] - master), last[0] + master),
        min(max(wanted[1], last[1] - slave), last[1] + slave),
    )


def limit_command(
    desired: Command,
    measurement: Measurement,
    active: float,
    dt: float,
    state: Supervision,
    limits: Limits,
) -> tuple[Command, int]:
    """Apply the soft limits to the desired command.

    The velocities of master and slave are reduced by the same factor, so that the operator feels
    the limit of the slave. In the direction of a soft position limit at distance d, the speed is
    at most sqrt(a d), where a is the greatest acceleration. A deceleration of a / 2 then stops the
    slave at the limit. If the contact force exceeds the soft force limit, the slave does not move
    against this force.

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

    Returns
    -------
    command
        Command that the soft limits allow.
    flags
        Sum of the flags of the soft limits that reduced the command.
    """
    master, slave = desired
    ramp = min(active / limits.start_ramp, 1.0)
    factor, flags = 1.0, 0
    for velocity, maximum in (
        (slave, limits.max_velocity * ramp),
        (master, limits.max_master_velocity * ramp),
    ):
        if abs(velocity) * factor > maximum:
            factor, flags = maximum / abs(velocity), VELOCITY
    low, high = limits.soft_position
    x, f = measurement.slave_position, measurement.contact_force
    distance = high - x if slave > 0.0 else x - low
    braking = math.sqrt(limits.max_acceleration * distance) if distance > 0.0 else 0.0
    if abs(slave) * factor > braking:
        factor = braking / abs(slave)
        flags |= POSITION
    if slave * f > 0.0 and abs(f) > limits.soft_force:
        factor = 0.0
        flags |= FORCE
    wanted = Command(master * factor, slave * factor) if factor < 1.0 else desired
    command = limit_acceleration(wanted, state.applied, dt, limits)
    if command != wanted:
        flags |= ACCELERATION
    return command, flags
