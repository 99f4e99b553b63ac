"""What the supervisor holds a tick against; each check tells the first thing that trips."""

from __future__ import annotations

import math

from drivers import CHANNELS, Command, Measurement
from teleop.safety.channels import Trip, Watch, check_channel
from teleop.safety.events import ACTIVE, Fault
from teleop.safety.limits import Limits
from teleop.safety.state import Request, Supervision

CONTACT_FORCE = CHANNELS.index("contact_force")
GAIN_ERROR = 0.05
"""Share of the commanded travel by which a drive may be off for good."""
LOST_TIME = 1.0
"""Time over which the share of skipped periods is taken [s]."""


def check_channels(
    state: Supervision, measurement: Measurement, dt: float, limits: Limits
) -> tuple[tuple[Watch, ...], Trip | None]:
    """Check every channel; the first that is not well trips."""
    master, slave = abs(state.applied[0]) * dt, abs(state.applied[1]) * dt
    first = None
    watches = []
    for name, watch, value, age, travel in zip(
        CHANNELS,
        state.watches,
        measurement[1:6],
        measurement.age,
        (0.0, master, slave, 0.0, state.accelerated),
        strict=True,
    ):
        watch, trip = check_channel(
            name, watch, value, age, measurement.time, travel, limits.channels[name]
        )
        watches.append(watch)
        first = first or trip
    return tuple(watches), first


def check_rig(measurement: Measurement) -> Trip | None:
    """What the rig says of itself."""
    now = measurement.time
    if measurement.emergency_stop:
        return Trip(Fault.EMERGENCY_STOP, "input", math.nan, math.nan, now)
    if measurement.drive_error:
        return Trip(Fault.DRIVE_ERROR, measurement.drive_error, math.nan, math.nan, now)
    return None


def check_loop(
    state: Supervision, now: float, dt: float, lost: float, limits: Limits
) -> Trip | None:
    """Hold the loop's own timing against its limits."""
    if not dt >= 0.0:
        source = f"time went from {state.time} s to {now} s: expected it to rise"
        return Trip(Fault.RIG_FAILURE, source, dt, 0.0, state.time)
    if dt > limits.max_gap:
        source = f"{dt * 1e3:.0f} ms between two ticks, at most {limits.max_gap * 1e3:g} ms"
        return Trip(Fault.OVERRUN, source, dt, limits.max_gap, state.time)
    if lost > limits.max_lost:
        source = f"{lost:.0%} of the periods skipped, at most {limits.max_lost:.0%}"
        return Trip(Fault.OVERRUN, source, lost, limits.max_lost, now)
    return None


def check_limits(measurement: Measurement, behind: float, limits: Limits) -> Trip | None:
    """Hold the slave against the hard limits, and against its command."""
    if trip := check_hard_limits(measurement, limits):
        return trip
    now, speed = measurement.time, measurement.slave_velocity
    if abs(speed) > 2.0 * limits.max_velocity:
        limit = 2.0 * limits.max_velocity
        return Trip(Fault.VELOCITY_LIMIT, "slave_velocity", speed, limit, now)
    if abs(behind) > limits.following_error:
        limit = limits.following_error
        return Trip(Fault.NOT_FOLLOWING, "slave_position", behind, limit, now)
    return None


def check_hard_limits(measurement: Measurement, limits: Limits) -> Trip | None:
    """Hold contact force and position against the limits that may never be passed."""
    now, x, f = measurement.time, measurement.slave_position, measurement.contact_force
    low, high = limits.hard_position
    if abs(f) > limits.hard_force:
        return Trip(Fault.FORCE_LIMIT, "contact_force", f, limits.hard_force, now)
    if x < low or x > high:
        return Trip(Fault.POSITION_LIMIT, "slave_position", x, high if x > high else low, now)
    return None


def check_command(state: Supervision, desired: Command, now: float) -> Trip | None:
    """Hold the desired command against being numbers."""
    if state.mode is not ACTIVE or (math.isfinite(desired[0]) and math.isfinite(desired[1])):
        return None
    source = f"the desired velocities are {desired[0]} and {desired[1]} m/s"
    return Trip(Fault.CONTROL_FAILURE, source, math.nan, math.nan, now)


def check_rest(measurement: Measurement, limits: Limits) -> Trip | None:
    """Hold slave and handle against what is expected before a start."""
    now, speed, handle = measurement.time, measurement.slave_velocity, measurement.master_force
    if abs(speed) > limits.rest_velocity:
        return Trip(Fault.NOT_AT_REST, "slave_velocity", speed, limits.rest_velocity, now)
    if abs(handle) > limits.rest_master_force:
        return Trip(Fault.NOT_AT_REST, "master_force", handle, limits.rest_master_force, now)
    return None


def departure(state: Supervision, measurement: Measurement, dt: float, limits: Limits) -> float:
    """How far the slave is behind its command, beyond what its drive explains [m]."""
    if math.isnan(state.position):
        return 0.0
    travel = state.applied.slave_velocity * dt
    behind = state.behind + travel - (measurement.slave_position - state.position)
    pressed = measurement.contact_force - state.watches[CONTACT_FORCE].value
    if pressed == pressed:
        behind -= limits.drive_compliance * pressed
    forgiven = min(GAIN_ERROR * abs(travel), abs(behind))
    return behind - math.copysign(forgiven, behind)


def share_lost(state: Supervision, request: Request, dt: float) -> float:
    """Share of periods that the loop has skipped lately."""
    share = request.skipped / (request.skipped + 1.0)
    return state.lost + (share - state.lost) * min(dt / LOST_TIME, 1.0)
