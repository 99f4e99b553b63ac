"""The soft limits: they hold a command back, and let the slave move away from them."""

from __future__ import annotations

import math

from drivers import STANDSTILL, Command, Measurement
from teleop.safety.limits import Limits
from teleop.safety.state import Supervision

VELOCITY, ACCELERATION, POSITION, FORCE = 1, 2, 4, 8
"""Flags of the soft limits that held a command back."""


def slowed(command: Command, dt: float, limits: Limits) -> Command:
    """The command a tick later on the ramp to zero."""
    return towards(STANDSTILL, command, dt, limits)


def towards(wanted: Command, last: Command, dt: float, limits: Limits) -> Command:
    """As near to the wanted command as the accelerations allow."""
    master, slave = limits.max_master_acceleration * dt, limits.max_acceleration * dt
    return Command(
        min(max(wanted[0], last[0] - master), last[0] + master),
        min(max(wanted[1], last[1] - slave), last[1] + slave),
    )


def limit(
    desired: Command,
    measurement: Measurement,
    active: float,
    dt: float,
    state: Supervision,
    limits: Limits,
) -> tuple[Command, int]:
    """The desired command within the soft limits, and the flags of those that held it back.

    Master and slave are slowed in the same proportion, so that the operator's hand feels what
    holds the slave. Towards a soft position limit the slave may go as fast as half of its
    deceleration can still brake; against a contact force beyond the soft limit not at all.
    """
    master, slave = desired
    opening = min(active / limits.start_ramp, 1.0)
    share, flags = 1.0, 0
    for velocity, most in (
        (slave, limits.max_velocity * opening),
        (master, limits.max_master_velocity * opening),
    ):
        if abs(velocity) * share > most:
            share, flags = most / abs(velocity), VELOCITY
    low, high = limits.soft_position
    x, f = measurement.slave_position, measurement.contact_force
    room = high - x if slave > 0.0 else x - low
    braking = math.sqrt(limits.max_acceleration * room) if room > 0.0 else 0.0
    if abs(slave) * share > braking:
        share = braking / abs(slave)
        flags |= POSITION
    if slave * f > 0.0 and abs(f) > limits.soft_force:
        share = 0.0
        flags |= FORCE
    wanted = Command(master * share, slave * share) if share < 1.0 else desired
    command = towards(wanted, state.applied, dt, limits)
    if command != wanted:
        flags |= ACCELERATION
    return command, flags
