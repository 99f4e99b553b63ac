"""The safety supervisor: one pure function between the desired command and the applied one.

    supervise(state, measurement, desired, request, limits) -> state, applied, events

It opens no file, reads no clock and keeps nothing: the loop hands it the state of the tick
before and does as it says. So every behaviour of docs/safety.md is tested without a rig.
"""

from __future__ import annotations

from drivers import STANDSTILL, Command, Measurement
from teleop.safety.checks import (
    check_channels,
    check_command,
    check_hard_limits,
    check_limits,
    check_loop,
    check_rest,
    check_rig,
    departure,
    share_lost,
)
from teleop.safety.events import (
    ACTIVE,
    DISCONNECTED,
    FAULT,
    IDLE,
    READY,
    STOPPING,
    Event,
    describe,
    stops_at_once,
)
from teleop.safety.limits import Limits
from teleop.safety.soft_limits import limit, slowed
from teleop.safety.state import Request, Supervision, Verdict

EARLY = 1e-6
"""Rounding of times [s]."""


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
    dt = now - state.time if state.time == state.time else 0.0 * now
    if state.mode is FAULT:
        return halted(state, measurement, dt, request, limits)

    watches, trip = check_channels(state, measurement, dt, limits)
    behind = departure(state, measurement, dt, limits)
    lost = share_lost(state, request, dt)
    trip = (
        request.trip
        or check_loop(state, now, dt, lost, limits)
        or check_rig(measurement)
        or trip
        or check_limits(measurement, behind, limits)
        or check_command(state, desired, now)
    )
    restless = state.mode < ACTIVE and check_rest(measurement, limits)
    if restless and request.arm:
        trip = trip or restless
    position = measurement.slave_position
    if trip:
        text = describe(trip.fault, trip.source, trip.value, trip.limit)
        event = Event(now, FAULT, text, *trip)
        state = Supervision(
            FAULT, now, now, state.applied, 0.0, position, behind, lost, watches, trip
        )
        verdict = halted(state, measurement, dt, request, limits)
        return verdict._replace(events=(event,))

    mode, command, limited, text = state.mode, STANDSTILL, 0, ""
    if mode is ACTIVE and not request.stop:
        command, limited = limit(desired, measurement, now - state.since, dt, state, limits)
    elif mode is ACTIVE:
        mode, text = STOPPING, request.stop
        command = slowed(state.applied, dt, limits)
    elif mode is STOPPING:
        command = slowed(state.applied, dt, limits)
        if command == STANDSTILL:
            mode, text = IDLE, "at standstill"
    elif mode is DISCONNECTED:
        mode, text = IDLE, "connected"
    elif request.stop:
        mode, text = IDLE, request.stop
    elif restless:
        mode, text = IDLE, "not at rest"
    elif mode is IDLE and now - state.since >= limits.preflight - EARLY:
        mode, text = READY, "ready"
    elif mode is READY and request.arm:
        mode, text = ACTIVE, "armed"
    if request.halt and mode is not READY:
        mode, command, limited, text = IDLE, STANDSTILL, 0, text or "stopped at once"

    since = state.since if mode is state.mode and not restless else now
    if mode is not state.mode and mode is ACTIVE:
        behind = 0.0
    events = (Event(now, mode, text),) if mode is not state.mode else ()
    accelerated = abs(command[1] - state.applied[1])
    state = Supervision(mode, since, now, command, accelerated, position, behind, lost, watches)
    enabled = mode is ACTIVE or mode is STOPPING
    return Verdict(state, command, enabled, limited, events)


def rearm(state: Supervision) -> Supervision:
    """Let a person leave the fault: back to the start, to be ready only if all is well.

    Raises
    ------
    ValueError
        There is no fault.
    """
    if state.mode is not FAULT:
        raise ValueError(f"only a fault is re-armed, the mode is {state.mode.name.lower()}")
    return Supervision()


def halted(
    state: Supervision, measurement: Measurement, dt: float, request: Request, limits: Limits
) -> Verdict:
    """In fault: ramp to zero, or stand still at once where the ramp may not be waited for."""
    assert state.tripped
    now, command = measurement.time, STANDSTILL
    events: tuple[Event, ...] = ()
    if state.applied != STANDSTILL and not stops_at_once(state.tripped.fault):
        worse = request.trip or check_rig(measurement) or check_hard_limits(measurement, limits)
        if worse and stops_at_once(worse.fault):
            text = describe(worse.fault, worse.source, worse.value, worse.limit)
            events = (Event(now, FAULT, f"while stopping: {text}", *worse),)
        elif not request.halt and dt >= 0.0:
            command = slowed(state.applied, dt, limits)
    state = state._replace(time=now, applied=command)
    return Verdict(state, command, command != STANDSTILL, 0, events)
