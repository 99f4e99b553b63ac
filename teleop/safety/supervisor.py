"""The safety supervisor, a pure function that converts the desired command to the applied command.

    supervise(state, measurement, desired, request, limits) -> state, command, events

The function opens no file, reads no clock and stores no data. The returned state contains all data
that are needed at the next tick, including faults. The loop passes this state to the function at
the next tick. The behaviour in docs/safety.md can therefore be tested without a rig.
"""

from __future__ import annotations

from collections.abc import Iterable

from drivers import STANDSTILL, Command, Measurement, new_tuple
from teleop.safety.channels import DetectedFault, check_channels
from teleop.safety.checks import (
    check_command,
    check_motion,
    check_rest,
    update_clock_drift,
    update_following_error,
    update_halting,
    update_skipped_fraction,
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
from teleop.safety.soft_limits import limit_command, ramp_down
from teleop.safety.state import Halting, Request, Supervision, Verdict

ROUNDING = 1e-6
"""Tolerance for rounding errors of times [s]."""


def supervise(
    state: Supervision,
    measurement: Measurement,
    desired: Command,
    request: Request,
    limits: Limits,
) -> Verdict:
    """Check the measurement of a tick, and compute the command that is sent to the drives."""
    now = measurement.time
    # The first tick has no previous time (NaN). 0 * now is NaN if the first time itself is invalid.
    dt = now - state.time if state.time == state.time else 0.0 * now
    following_error, followed = update_following_error(state, measurement, dt, limits)
    skipped_fraction = update_skipped_fraction(state, request, dt)
    drift = update_clock_drift(state, request, dt)
    position = measurement.slave_position
    enabled = state.enabled
    halting, moving = update_halting(state.halting, measurement, limits)
    # Only a person can leave the mode fault (`rearm`). While the ramp lasts, only what requires an
    # immediate stop is still checked.
    if state.mode is FAULT:
        state = state._replace(
            time=now,
            position=position,
            following_error=following_error,
            followed=followed,
            skipped_fraction=skipped_fraction,
            drift=drift,
            halting=halting,
        )
        faults = [*moving, *request.faults]
        if state.applied != STANDSTILL:
            faults += check_motion(
                measurement, dt, following_error, skipped_fraction, drift, limits
            )
        verdict = stop_for_faults(state, faults, dt, request.halt, limits)
        return halted(verdict, enabled, measurement)

    applied = state.applied
    # The order is that of CHANNELS. Forces can be constant, so that they are never frozen by a
    # travel.
    travels = (0.0, abs(applied[0]) * dt, abs(applied[1]) * dt, 0.0, state.velocity_change)
    channel_states, faults = check_channels(
        state.channel_states, measurement, travels, limits.channels
    )
    faults += check_motion(measurement, dt, following_error, skipped_fraction, drift, limits)
    faults += moving
    faults += request.faults
    if state.mode is ACTIVE:
        faults += check_command(desired, now)
    # Before the drives are armed, motion is no fault: a person may move the slave. It only delays
    # the mode ready. A request to arm at this tick is refused with a fault.
    not_at_rest = state.mode < ACTIVE and check_rest(measurement, limits)
    if not_at_rest and request.arm:
        faults.append(not_at_rest)
    # The faults start the ramp from the velocities that the drives have now.
    if faults:
        state = Supervision(
            FAULT,
            now,
            now,
            state.applied,
            0.0,
            position,
            following_error,
            followed,
            skipped_fraction,
            drift,
            channel_states,
            halting,
        )
        verdict = stop_for_faults(state, faults, dt, request.halt, limits)
        return halted(verdict, enabled, measurement)

    mode, command, limited, text = state.mode, STANDSTILL, 0, ""
    if mode is ACTIVE and not request.stop:
        command, limited = limit_command(
            desired, measurement, now - state.since, dt, state, limits, request.stiffness
        )
    elif mode is ACTIVE:
        mode, text = STOPPING, request.stop
        command = ramp_down(state.applied, dt, limits)
    elif mode is STOPPING:
        command = ramp_down(state.applied, dt, limits)
        if command == STANDSTILL:
            mode, text = IDLE, "at standstill"
    elif mode is DISCONNECTED:
        mode, text = IDLE, "connected"
    elif request.stop:
        mode, text = IDLE, request.stop
    elif not_at_rest:
        mode, text = IDLE, "not at rest"
    elif mode is IDLE and now - state.since >= limits.preflight - ROUNDING:
        mode, text = READY, "ready"
    # The mode must have been ready at the previous tick too: a request that waited for it arms
    # nothing.
    arm = mode is READY and state.mode is READY and request.arm and not request.halt
    # A halt omits the ramp. In the mode ready, the drives are disabled already.
    if request.halt and mode is not READY:
        mode, command, limited, text = IDLE, STANDSTILL, 0, text or "stopped at once"

    events = (Event(now, mode, text),) if mode is not state.mode else ()
    # Each motion restarts the time for which the slave must be at rest before the mode ready.
    since = state.since if mode is state.mode and not not_at_rest else now
    velocity_change = abs(command[1] - state.applied[1])
    # new_tuple avoids the time that the constructor of a NamedTuple takes.
    values = (
        mode,
        since,
        now,
        command,
        velocity_change,
        position,
        following_error,
        followed,
        skipped_fraction,
        drift,
        channel_states,
        halting,
        (),
    )
    state = new_tuple(Supervision, values)
    verdict = new_tuple(Verdict, (state, command, limited, events, arm))
    return verdict if mode is ACTIVE else halted(verdict, enabled, measurement)


def halted(verdict: Verdict, enabled: bool, measurement: Measurement) -> Verdict:
    """Return the verdict. If it disables the drives, its state observes whether the slave halts."""
    # Only the tick at which the drives are disabled starts the observation.
    if not enabled or verdict.enabled:
        return verdict
    now, x = measurement.time, measurement.slave_position
    return verdict._replace(state=verdict.state._replace(halting=Halting(now, x, now, x)))


def activate(verdict: Verdict) -> Verdict:
    """Change the mode from ready to active, at the tick at which all drives are in operation.

    The command of this tick is zero velocity.
    """
    now = verdict.state.time
    state = verdict.state._replace(mode=ACTIVE, since=now, following_error=0.0, halting=None)
    return Verdict(state, STANDSTILL, events=(Event(now, ACTIVE, "armed"),))


def stop_for_faults(
    state: Supervision, faults: Iterable[DetectedFault], dt: float, halt: bool, limits: Limits
) -> Verdict:
    """Return the output of the supervisor at a tick in the mode fault.

    The command decreases to zero on a ramp. It is zero immediately if `halt` is True, if a fault
    requires an immediate stop, or if `dt` is negative. Each kind of fault is stored and reported
    only once. Faults that are detected at the same tick are ordered by severity, the most severe
    first.
    """
    known = {cause.fault for cause in state.causes}
    events: list[Event] = []
    for detected in sorted(faults, key=lambda detected: SEVERITY[detected.fault]):
        if detected.fault not in known:
            known.add(detected.fault)
            text = describe(detected.fault, detected.source, detected.value, detected.limit)
            events.append(Event(state.time, FAULT, text, *detected))
            state = state._replace(causes=(*state.causes, detected))
    # With a negative dt, the clock is wrong, so that a ramp would have no known duration.
    ramp = dt >= 0.0 and not halt and not state.immediate
    command = ramp_down(state.applied, dt, limits) if ramp else STANDSTILL
    return Verdict(state._replace(applied=command), command, events=tuple(events))


def rearm(state: Supervision) -> Supervision:
    """Return the initial state, to leave the mode fault if a person wants to arm again.

    The supervisor then repeats all checks that it makes before arming.
    """
    if state.mode is not FAULT:
        raise ValueError(
            f"re-arming is possible in mode fault only: the mode is {state.mode.name.lower()}"
        )
    return Supervision()
