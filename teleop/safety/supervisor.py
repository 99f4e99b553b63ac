"""The safety supervisor: one pure function between the desired command and the applied one.

    supervise(state, measurement, desired, request, limits) -> state, applied, events

It opens no file, reads no clock and keeps nothing: the loop hands it the state of the tick
before and does as it says. So every behaviour of docs/safety.md is tested without a rig.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import CHANNELS, STANDSTILL, Command, Measurement
from teleop.safety.channels import Trip, Watch, check_channel
from teleop.safety.events import Event, Fault, Mode, describe, stops_at_once
from teleop.safety.limits import Limits

CONTACT_FORCE = CHANNELS.index("contact_force")
FOLLOWING_TIME = 0.5
"""Time within which a departure from the command is forgiven [s]."""
LOST_TIME = 1.0
"""Time over which the share of skipped periods is taken [s]."""

VELOCITY, ACCELERATION, POSITION, FORCE = 1, 2, 4, 8
"""Flags of the soft limits that held a command back."""


class Request(NamedTuple):
    """What the person and the loop want of the supervisor at a tick."""

    arm: bool = False
    """Go from ready to active."""
    stop: str = ""
    """Why to come to a stop in good order; empty to go on."""
    halt: bool = False
    """Whether to stop without a ramp."""
    trip: Trip | None = None
    """A fault that the loop found: an exception, the emergency-stop key."""
    skipped: int = 0
    """Whole periods that the loop left out before this tick."""


NO_REQUEST = Request()


class Supervision(NamedTuple):
    """The supervisor's state."""

    mode: Mode = Mode.DISCONNECTED
    since: float = math.nan
    """When the mode was entered [s]."""
    time: float = math.nan
    """Of the tick before [s]."""
    applied: Command = STANDSTILL
    """The last command."""
    accelerated: float = 0.0
    """By how much it changed the slave's velocity [m/s]."""
    position: float = math.nan
    """The last position of the slave [m]."""
    behind: float = 0.0
    """How far the slave is behind its command and its drive's compliance [m].

    Leaks within `FOLLOWING_TIME`.
    """
    lost: float = 0.0
    """Share of periods that the loop has skipped lately."""
    watches: tuple[Watch, ...] = (Watch(),) * len(CHANNELS)
    """What is remembered of each channel."""
    tripped: Trip | None = None
    """What tripped; None unless the mode is fault."""


class Verdict(NamedTuple):
    """What the supervisor decides at a tick."""

    state: Supervision
    command: Command
    """What to apply."""
    enabled: bool
    """Whether the drives are to be in operation."""
    limited: int
    """Flags of the soft limits that held the command back."""
    events: tuple[Event, ...]


def supervise(
    state: Supervision,
    measurement: Measurement,
    desired: Command,
    request: Request,
    limits: Limits,
) -> Verdict:
    """Decide what is applied at this tick.

    Parameters
    ----------
    state
        What the supervisor returned at the tick before.
    measurement
        What the rig reads.
    desired
        What the control condition wants; counts in active mode alone.
    request
        What person and loop want.
    limits
        Limits of rig and channels.
    """
    now = measurement.time
    dt = now - state.time if state.time == state.time else 0.0
    if state.mode is Mode.FAULT:
        return halted(state, now, dt, limits)

    watches, trip = check_channels(state, measurement, dt, limits)
    moved = measurement.slave_position - state.position
    behind = lost = 0.0
    if dt > 0.0:
        pressed = measurement.contact_force - state.watches[CONTACT_FORCE].value
        yielded = limits.drive_compliance * pressed
        behind = state.behind + state.applied.slave_velocity * dt - moved - yielded
        behind -= state.behind * min(dt / FOLLOWING_TIME, 1.0)
        share = request.skipped / (request.skipped + 1.0)
        lost = state.lost + (share - state.lost) * min(dt / LOST_TIME, 1.0)
    trip = (
        request.trip
        or check_loop(state, now, dt, lost, limits)
        or check_rig(measurement)
        or trip
        or check_limits(state, measurement, desired, behind, limits)
    )
    position = measurement.slave_position
    if trip:
        text = describe(trip.fault, trip.source, trip.value, trip.limit)
        event = Event(now, Mode.FAULT, text, *trip)
        state = Supervision(
            Mode.FAULT, now, now, state.applied, 0.0, position, behind, lost, watches, trip
        )
        verdict = halted(state, now, dt, limits)
        return verdict._replace(events=(event,))

    mode, command, limited, text = state.mode, STANDSTILL, 0, ""
    if mode is Mode.ACTIVE and not request.stop:
        command, limited = limit(desired, measurement, now - state.since, dt, state, limits)
    elif mode is Mode.ACTIVE:
        mode, text = Mode.STOPPING, request.stop
        command = slowed(state.applied, dt, limits)
    elif mode is Mode.STOPPING:
        command = slowed(state.applied, dt, limits)
        if command == STANDSTILL:
            mode, text = Mode.IDLE, "at standstill"
    elif mode is Mode.DISCONNECTED:
        mode, text = Mode.IDLE, "connected"
    elif request.stop:
        mode, text = Mode.IDLE, request.stop
    elif mode is Mode.IDLE and now - state.since >= limits.preflight - 0.5 * dt:
        mode, text = Mode.READY, "ready"
    elif mode is Mode.READY and request.arm:
        mode, text = Mode.ACTIVE, "armed"
    if request.halt and mode is not Mode.READY:
        mode, command, text = Mode.IDLE, STANDSTILL, text or "stopped at once"

    since = state.since if mode is state.mode else now
    if mode is not state.mode and mode is Mode.ACTIVE:
        behind = 0.0
    events = (Event(now, mode, text),) if mode is not state.mode else ()
    accelerated = abs(command[1] - state.applied[1])
    state = Supervision(mode, since, now, command, accelerated, position, behind, lost, watches)
    enabled = mode is Mode.ACTIVE or mode is Mode.STOPPING
    return Verdict(state, command, enabled, limited, events)


def rearm(state: Supervision) -> Supervision:
    """Let a person leave the fault: back to the start, to be ready only if all is well.

    Raises
    ------
    ValueError
        There is no fault.
    """
    if state.mode is not Mode.FAULT:
        raise ValueError(f"only a fault is re-armed, the mode is {state.mode.name.lower()}")
    return Supervision()


def halted(state: Supervision, now: float, dt: float, limits: Limits) -> Verdict:
    """In fault: ramp to zero or stand still, and stay there."""
    assert state.tripped
    command = STANDSTILL
    if not stops_at_once(state.tripped.fault):
        command = slowed(state.applied, dt, limits)
    state = state._replace(time=now, applied=command)
    return Verdict(state, command, command != STANDSTILL, 0, ())


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
    if dt > limits.max_gap:
        source = f"{dt * 1e3:.0f} ms between two ticks, at most {limits.max_gap * 1e3:g} ms"
        return Trip(Fault.OVERRUN, source, dt, limits.max_gap, state.time)
    if lost > limits.max_lost:
        source = f"{lost:.0%} of the periods skipped, at most {limits.max_lost:.0%}"
        return Trip(Fault.OVERRUN, source, lost, limits.max_lost, now)
    return None


def check_limits(
    state: Supervision,
    measurement: Measurement,
    desired: Command,
    behind: float,
    limits: Limits,
) -> Trip | None:
    """Hold the slave and the command against the hard limits."""
    now, x, f = measurement.time, measurement.slave_position, measurement.contact_force
    speed, handle = measurement.slave_velocity, measurement.master_force
    low, high = limits.hard_position
    if abs(f) > limits.hard_force:
        return Trip(Fault.FORCE_LIMIT, "contact_force", f, limits.hard_force, now)
    if not low <= x <= high:
        return Trip(Fault.POSITION_LIMIT, "slave_position", x, high if x > high else low, now)
    if abs(speed) > 2.0 * limits.max_velocity:
        limit = 2.0 * limits.max_velocity
        return Trip(Fault.VELOCITY_LIMIT, "slave_velocity", speed, limit, now)
    if abs(behind) > limits.following_error:
        limit = limits.following_error
        return Trip(Fault.NOT_FOLLOWING, "slave_position", behind, limit, now)
    if not (math.isfinite(desired[0]) and math.isfinite(desired[1])):
        source = f"the desired velocities are {desired[0]} and {desired[1]} m/s"
        return Trip(Fault.CONTROL_FAILURE, source, math.nan, math.nan, now)
    if state.mode < Mode.ACTIVE:
        if abs(speed) > limits.rest_velocity:
            return Trip(Fault.NOT_AT_REST, "slave_velocity", speed, limits.rest_velocity, now)
        if abs(handle) > limits.rest_master_force:
            return Trip(Fault.NOT_AT_REST, "master_force", handle, limits.rest_master_force, now)
    return None


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
