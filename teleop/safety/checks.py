"""The supervisor's checks of a tick."""

from __future__ import annotations

import math

from drivers import CHANNELS, Command, Measurement
from teleop.safety.channels import Trip, Watch, check_channel
from teleop.safety.events import DISCONNECTED, Fault
from teleop.safety.limits import Limits
from teleop.safety.state import Request, Supervision

CONTACT_FORCE = CHANNELS.index("contact_force")
GAIN_ERROR = 0.05
"""Share of the commanded travel by which a drive may be permanently off."""
MEMORY = 1.0
"""Time over which skipped periods and the drift of the rig's clock are judged [s]."""


def check_channels(
    state: Supervision, measurement: Measurement, dt: float, limits: Limits
) -> tuple[tuple[Watch, ...], list[Trip]]:
    """Check every channel; its memory, and the faults found."""
    master, slave = abs(state.applied[0]) * dt, abs(state.applied[1]) * dt
    trips = []
    watches = []
    for name, watch, value, age, travel in zip(
        CHANNELS,
        state.watches,
        measurement.channels,
        measurement.age,
        (0.0, master, slave, 0.0, state.accelerated),
        strict=True,
    ):
        watch, trip = check_channel(
            name, watch, value, age, measurement.time, travel, limits.channels[name]
        )
        watches.append(watch)
        if trip:
            trips.append(trip)
    return tuple(watches), trips


def check_motion(
    measurement: Measurement, dt: float, behind: float, lost: float, drift: float, limits: Limits
) -> list[Trip]:
    """Check everything that makes a moving slave stop at once."""
    trips = check_rig(measurement)
    trips += check_loop(measurement.time, dt, lost, drift, limits)
    trips += check_limits(measurement, behind, limits)
    return trips


def check_rig(measurement: Measurement) -> list[Trip]:
    """Check what the rig reports of itself."""
    trips, now = [], measurement.time
    if measurement.emergency_stop:
        trips.append(Trip(Fault.EMERGENCY_STOP, "input", math.nan, math.nan, now))
    if measurement.drive_error:
        trips.append(Trip(Fault.DRIVE_ERROR, measurement.drive_error, math.nan, math.nan, now))
    return trips


def check_loop(now: float, dt: float, lost: float, drift: float, limits: Limits) -> list[Trip]:
    """Check the timing of the loop and of the measurements."""
    trips = []
    if not dt >= 0.0:
        source = f"time went from {now - dt} s to {now} s: expected it to rise"
        trips.append(Trip(Fault.RIG_FAILURE, source, dt, 0.0, now - dt))
    if drift > limits.max_gap:
        source = (
            f"the rig's time fell {drift * 1e3:.0f} ms behind the loop's: expected it to rise "
            "with each measurement"
        )
        trips.append(Trip(Fault.RIG_FAILURE, source, drift, limits.max_gap, now))
    if dt > limits.max_gap:
        source = f"{dt * 1e3:.0f} ms between two ticks, at most {limits.max_gap * 1e3:g} ms"
        trips.append(Trip(Fault.OVERRUN, source, dt, limits.max_gap, now - dt))
    if lost > limits.max_lost:
        source = f"{lost:.0%} of the periods skipped, at most {limits.max_lost:.0%}"
        trips.append(Trip(Fault.OVERRUN, source, lost, limits.max_lost, now))
    return trips


def check_limits(measurement: Measurement, behind: float, limits: Limits) -> list[Trip]:
    """Check contact force and motion of the slave against the hard limits.

    A sample that is infinite or no number is a fault of its channel.
    """
    trips = []
    now, x, f = measurement.time, measurement.slave_position, measurement.contact_force
    speed, fastest = measurement.slave_velocity, 2.0 * limits.max_velocity
    low, high = limits.hard_position
    if limits.hard_force < abs(f) < math.inf:
        trips.append(Trip(Fault.FORCE_LIMIT, "contact_force", f, limits.hard_force, now))
    if not low <= x <= high and math.isfinite(x):
        limit = high if x > high else low
        trips.append(Trip(Fault.POSITION_LIMIT, "slave_position", x, limit, now))
    if fastest < abs(speed) < math.inf:
        trips.append(Trip(Fault.VELOCITY_LIMIT, "slave_velocity", speed, fastest, now))
    if limits.following_error < abs(behind) < math.inf:
        limit = limits.following_error
        trips.append(Trip(Fault.NOT_FOLLOWING, "slave_position", behind, limit, now))
    return trips


def check_command(desired: Command, now: float) -> list[Trip]:
    """Check that the desired command is finite."""
    if math.isfinite(desired[0]) and math.isfinite(desired[1]):
        return []
    source = f"the desired velocities are {desired[0]} and {desired[1]} m/s"
    return [Trip(Fault.CONTROL_FAILURE, source, math.nan, math.nan, now)]


def check_rest(measurement: Measurement, limits: Limits) -> Trip | None:
    """Check that slave and handle are at rest, as a start requires."""
    now, speed, handle = measurement.time, measurement.slave_velocity, measurement.master_force
    if abs(speed) > limits.rest_velocity:
        return Trip(Fault.NOT_AT_REST, "slave_velocity", speed, limits.rest_velocity, now)
    if abs(handle) > limits.rest_master_force:
        return Trip(Fault.NOT_AT_REST, "master_force", handle, limits.rest_master_force, now)
    return None


def departure(state: Supervision, measurement: Measurement, dt: float, limits: Limits) -> float:
    """Departure of the slave from its command, less what its drive explains [m].

    A time step that `check_loop` refuses is left out: the command during it is not known.
    """
    if math.isnan(state.position):
        return 0.0
    if not 0.0 <= dt <= limits.max_gap:
        return state.behind
    travel = state.applied.slave_velocity * dt
    behind = state.behind + travel - (measurement.slave_position - state.position)
    pressed = measurement.contact_force - state.watches[CONTACT_FORCE].value
    if pressed == pressed:
        behind -= limits.drive_compliance * pressed
    forgiven = min(GAIN_ERROR * abs(travel), abs(behind))
    return behind - math.copysign(forgiven, behind)


def share_lost(state: Supervision, request: Request, dt: float) -> float:
    """Share of periods that the loop has skipped in about the last `MEMORY`."""
    share = request.skipped / (request.skipped + 1.0)
    return state.lost + (share - state.lost) * min(max(dt, 0.0) / MEMORY, 1.0)


def clock_drift(state: Supervision, request: Request, dt: float, limits: Limits) -> float:
    """Time by which the measurements' clock fell behind the loop's, in about `MEMORY` [s].

    A jump ahead counts for no more than the longest gap, so that it hides no standstill.
    """
    if state.mode is DISCONNECTED:
        return 0.0
    kept = 1.0 - min(request.elapsed / MEMORY, 1.0)
    return max(state.drift * kept + request.elapsed - dt, -limits.max_gap)
