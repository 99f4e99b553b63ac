"""The safety supervisor: one pure function from the desired command to the applied one.

    supervise(state, measurement, desired, request, limits) -> state, command, events

It opens no file, reads no clock and keeps nothing: all memory, that of faults included, is in the
state that the loop passes back at the next tick. Every behaviour of docs/safety.md is tested
without a rig.
"""

from __future__ import annotations

from collections.abc import Iterable

from drivers import STANDSTILL, Command, Measurement
from teleop.safety.channels import Trip
from teleop.safety.checks import (
    check_channels,
    check_command,
    check_motion,
    check_rest,
    clock_drift,
    departure,
    share_lost,
)
from teleop.safety.events import (
    ACTIVE,
    DISCONNECTED,
    FAULT,
    IDLE,
    READY,
    SEVERITY,
    STOPPING,
    Event,
    describe,
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
        State that the supervisor returned at the tick before.
    measurement
        Measurement of the rig.
    desired
        Command that the control condition wants; counts in active mode alone.
    request
        Requests of person and loop.
    limits
        Limits of rig and channels.
    """
    now = measurement.time
    dt = now - state.time if state.time == state.time else 0.0 * now
    behind = departure(state, measurement, dt, limits)
    lost = share_lost(state, request, dt)
    drift = clock_drift(state, request, dt, limits)
    position = measurement.slave_position
    if state.mode is FAULT:
        state = state._replace(time=now, position=position, behind=behind, lost=lost, drift=drift)
        found = list(request.trips)
        if state.applied != STANDSTILL:
            found += check_motion(measurement, dt, behind, lost, drift, limits)
        return stopped(state, found, dt, request.halt, limits)

    watches, found = check_channels(state, measurement, dt, limits)
    found += check_motion(measurement, dt, behind, lost, drift, limits)
    found += request.trips
    if state.mode is ACTIVE:
        found += check_command(desired, now)
    restless = state.mode < ACTIVE and check_rest(measurement, limits)
    if restless and request.arm:
        found.append(restless)
    if found:
        state = Supervision(
            FAULT, now, now, state.applied, 0.0, position, behind, lost, drift, watches
        )
        return stopped(state, found, dt, request.halt, limits)

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
    arm = mode is READY and state.mode is READY and request.arm and not request.halt
    if request.halt and mode is not READY:
        mode, command, limited, text = IDLE, STANDSTILL, 0, text or "stopped at once"

    events = (Event(now, mode, text),) if mode is not state.mode else ()
    since = state.since if mode is state.mode and not restless else now
    accelerated = abs(command[1] - state.applied[1])
    state = Supervision(
        mode, since, now, command, accelerated, position, behind, lost, drift, watches
    )
    return Verdict(state, command, limited, events, arm)


def activated(verdict: Verdict) -> Verdict:
    """The verdict at the tick at which the drives, which it allows to be armed, are enabled."""
    now = verdict.state.time
    state = verdict.state._replace(mode=ACTIVE, since=now, behind=0.0)
    return Verdict(state, STANDSTILL, events=(Event(now, ACTIVE, "armed"),))


def stopped(
    state: Supervision, found: Iterable[Trip], dt: float, halt: bool, limits: Limits
) -> Verdict:
    """In fault, ramp to zero, or stand still at once if any of its causes demands it.

    Each kind of fault is kept and reported once, of those found at one tick the most severe first.
    """
    known = {cause.fault for cause in state.causes}
    events: list[Event] = []
    for trip in sorted(found, key=lambda trip: SEVERITY[trip.fault]):
        if trip.fault not in known:
            known.add(trip.fault)
            text = describe(trip.fault, trip.source, trip.value, trip.limit)
            events.append(Event(state.time, FAULT, text, *trip))
            state = state._replace(causes=(*state.causes, trip))
    ramp = dt >= 0.0 and not halt and not state.at_once
    command = slowed(state.applied, dt, limits) if ramp else STANDSTILL
    return Verdict(state._replace(applied=command), command, events=tuple(events))


def rearm(state: Supervision) -> Supervision:
    """Let a person leave the fault: back to the start, through the preflight again.

    Raises
    ------
    ValueError
        There is no fault.
    """
    if state.mode is not FAULT:
        raise ValueError(f"only a fault is re-armed, the mode is {state.mode.name.lower()}")
    return Supervision()
