"""Checks that the safety supervisor makes at each tick."""

from __future__ import annotations

import math

from drivers import CHANNELS, Command, Measurement
from teleop.safety.channels import DetectedFault
from teleop.safety.events import DISCONNECTED, IDLE, Fault
from teleop.safety.limits import Limits
from teleop.safety.state import Halting, Request, Supervision

CONTACT_FORCE = CHANNELS.index("contact_force")
POSITION = "slave_position"
REST = 0.05
"""Time for which the slave must not move to be at rest after a stop [s]."""
LONGEST_HALT = 0.5
"""Longest time from a stop until the slave must be at rest [s].

It is longer than the watchdog times of the drives, and the time in which friction stops a slave
that coasts: a slave with 0.2 m/s and a friction of 0.04 times its weight coasts for 0.5 s.
"""
PUSHING = 0.05
"""Smallest contact force that can push the slave after a stop, as a fraction of the soft limit."""
FALLING = 0.98
"""Largest ratio of the force of an elastic specimen to its force before, while it pushes the slave.

A constant force, such as a wrong zero of the sensor, and the force of a specimen into which a drive
presses again and again, are no explanations of motion.
"""
GAIN_ERROR = 0.05
"""Allowed gain error of a drive, as a fraction of the commanded travel."""
AVERAGING_TIME = 1.0
"""Averaging time for the fraction of skipped periods and for the drift of the rig's clock [s].

The rig's clock is the time of the measurements.
"""


def check_motion(
    measurement: Measurement,
    dt: float,
    following_error: float,
    skipped_fraction: float,
    drift: float,
    limits: Limits,
) -> list[DetectedFault]:
    """Check errors of the rig, the timing of the loop, and the hard limits; return the faults.

    The faults that this function can return stop the drives immediately. The velocity is not first
    reduced on a ramp, even if the slave moves fast.
    """
    faults = check_rig(measurement)
    faults += check_loop(measurement.time, dt, skipped_fraction, drift, limits)
    faults += check_limits(measurement, following_error, limits)
    return faults


def check_rig(measurement: Measurement) -> list[DetectedFault]:
    """Return the faults that the rig reports: an emergency stop, and an error of a device."""
    faults, now = [], measurement.time
    if measurement.emergency_stop:
        faults.append(DetectedFault(Fault.EMERGENCY_STOP, "input", math.nan, math.nan, now))
    if measurement.drive_error:
        faults.append(
            DetectedFault(Fault.DRIVE_ERROR, measurement.drive_error, math.nan, math.nan, now)
        )
    return faults


def check_loop(
    now: float, dt: float, skipped_fraction: float, drift: float, limits: Limits
) -> list[DetectedFault]:
    """Return faults of timing: overruns of the control loop, and a wrong clock of the rig.

    `drift` is the time by which the clock of the rig is behind the clock of the loop [s].
    """
    faults = []
    if not dt >= 0.0:
        source = f"the rig's time went from {now - dt} s to {now} s: expected it to increase"
        faults.append(DetectedFault(Fault.RIG_FAILURE, source, dt, 0.0, now - dt))
    if drift > limits.max_gap:
        source = (
            f"the rig's time is {drift * 1e3:.0f} ms behind the loop's: expected it to increase "
            "with each measurement"
        )
        faults.append(DetectedFault(Fault.RIG_FAILURE, source, drift, limits.max_gap, now))
    if dt > limits.max_gap:
        source = f"{dt * 1e3:.0f} ms between two ticks, at most {limits.max_gap * 1e3:g} ms"
        faults.append(DetectedFault(Fault.OVERRUN, source, dt, limits.max_gap, now - dt))
    if skipped_fraction > limits.max_skipped_fraction:
        source = (
            f"{skipped_fraction:.0%} of the periods skipped, "
            f"at most {limits.max_skipped_fraction:.0%}"
        )
        faults.append(
            DetectedFault(Fault.OVERRUN, source, skipped_fraction, limits.max_skipped_fraction, now)
        )
    return faults


def check_limits(
    measurement: Measurement, following_error: float, limits: Limits
) -> list[DetectedFault]:
    """Return a fault for each hard limit that the contact force or the motion of the slave exceeds.

    Values that are infinite or NaN are not checked here, because `check_channels` detects them.
    """
    faults = []
    now, x, f = measurement.time, measurement.slave_position, measurement.contact_force
    speed, fastest = measurement.slave_velocity, 2.0 * limits.max_velocity
    low, high = limits.hard_position
    if limits.hard_force < abs(f) < math.inf:
        faults.append(DetectedFault(Fault.FORCE_LIMIT, "contact_force", f, limits.hard_force, now))
    if not low <= x <= high and math.isfinite(x):
        limit = high if x > high else low
        faults.append(DetectedFault(Fault.POSITION_LIMIT, "slave_position", x, limit, now))
    if fastest < abs(speed) < math.inf:
        faults.append(DetectedFault(Fault.VELOCITY_LIMIT, "slave_velocity", speed, fastest, now))
    if limits.following_error < abs(following_error) < math.inf:
        limit = limits.following_error
        faults.append(
            DetectedFault(Fault.NOT_FOLLOWING, "slave_position", following_error, limit, now)
        )
    return faults


def update_halting(
    halting: Halting | None, measurement: Measurement, limits: Limits
) -> tuple[Halting | None, list[DetectedFault]]:
    """Check whether the slave comes to rest after its drives were disabled.

    The slave is at rest if it moved less than `Limits.rest_velocity` times `REST` within `REST`. A
    slave without power is decelerated by its brake or by friction. The elastic specimen can push it
    for some time. Motion in the direction of a falling contact force is therefore permitted. It is
    a fault if the slave has not been at rest for `LONGEST_HALT` otherwise, and has moved by more
    than the limit of the following error. After the slave has come to rest, its motion is not
    checked, because a person may move it. While the position is not known, nothing is checked.
    """
    now, x, f = measurement.time, measurement.slave_position, measurement.contact_force
    if not limits.channels[POSITION].required:  # a rig without a slave
        return None, []
    if not halting or not math.isfinite(x):
        return halting, []
    if not measurement.age.slave_position <= limits.channels[POSITION].max_age:
        return halting, []
    if halting.position != halting.position:
        return Halting(now, x, now, x), []
    step = x - halting.position
    if not abs(step) > limits.rest_velocity * REST:
        return (halting if now - halting.moved < REST else None), []
    if step * f < 0.0 and PUSHING * limits.soft_force < abs(f) < FALLING * halting.pushing:
        return Halting(now, x, now, x, abs(f)), []
    halting = halting._replace(moved=now, position=x)
    took, travel = now - halting.since, x - halting.start
    if took <= LONGEST_HALT or not abs(travel) > limits.following_error:
        return halting, []
    source = f"{took:.1f} s"
    limit = limits.following_error
    return halting, [DetectedFault(Fault.MOVES_AFTER_STOP, source, travel, limit, halting.since)]


def check_command(desired: Command, now: float) -> list[DetectedFault]:
    """Return a fault if a velocity of the desired command is infinite or NaN.

    `now` is the time of this tick [s]. The returned list is empty if there is no fault.
    """
    if math.isfinite(desired[0]) and math.isfinite(desired[1]):
        return []
    source = f"the desired velocities are {desired[0]} and {desired[1]} m/s"
    return [DetectedFault(Fault.CONTROL_FAILURE, source, math.nan, math.nan, now)]


def check_rest(measurement: Measurement, limits: Limits) -> DetectedFault | None:
    """Return a fault if the slave moves or a force acts on the handle; otherwise return None.

    The drives may be armed only at rest.
    """
    now, speed, handle = measurement.time, measurement.slave_velocity, measurement.master_force
    if abs(speed) > limits.rest_velocity:
        return DetectedFault(Fault.NOT_AT_REST, "slave_velocity", speed, limits.rest_velocity, now)
    if abs(handle) > limits.rest_master_force:
        return DetectedFault(
            Fault.NOT_AT_REST, "master_force", handle, limits.rest_master_force, now
        )
    return None


def update_following_error(
    state: Supervision, measurement: Measurement, dt: float, limits: Limits
) -> tuple[float, float]:
    """Return the following error of the slave [m], and the velocity with which it follows [m/s].

    The following error is the commanded travel minus the measured travel, summed over the ticks.
    The commanded travel is that of a drive with the lag `Limits.drive_lag` (of first order). At
    each tick, two parts of the difference are subtracted, because they are not errors. One part is
    the displacement of the drive by the contact force (compliance times change of force). The other
    part is an allowed gain error of at most `GAIN_ERROR` times the commanded travel.

    In the mode idle, the drives are disabled, and the slave follows no command.

    If `dt` is negative or larger than `Limits.max_gap`, the commanded travel is not known. The
    following error of the previous tick is then returned.
    """
    before = state.position
    if before != before or state.mode is IDLE:
        return 0.0, 0.0
    if not 0.0 <= dt <= limits.max_gap:
        return state.following_error, state.followed
    followed = state.applied[1]
    travel = followed * dt
    if lag := limits.drive_lag:
        behind = state.followed - followed
        left = behind * math.exp(-dt / lag)
        travel += (behind - left) * lag
        followed += left
    error = state.following_error + travel - (measurement.slave_position - before)
    pressed = measurement.contact_force - state.channel_states[CONTACT_FORCE].value
    if pressed == pressed:
        error -= limits.drive_compliance * pressed
    tolerated = min(GAIN_ERROR * abs(travel), abs(error))
    return error - math.copysign(tolerated, error), followed


def update_skipped_fraction(state: Supervision, request: Request, dt: float) -> float:
    """Return the fraction of its periods that the loop skipped, averaged over `AVERAGING_TIME`.

    The loop skips whole periods if it is late by a period or more.
    """
    if not (request.skipped or state.skipped_fraction):
        return 0.0
    fraction = request.skipped / (request.skipped + 1.0)
    weight = min(max(dt, 0.0) / AVERAGING_TIME, 1.0)
    return state.skipped_fraction + (fraction - state.skipped_fraction) * weight


def update_clock_drift(state: Supervision, request: Request, dt: float) -> float:
    """Return the time [s] by which the rig's clock recently fell behind the loop's clock.

    The rig's clock is the time of the measurements. The result depends only on about the last
    `AVERAGING_TIME` seconds. It is never negative: otherwise a forward jump of the rig's clock
    would hide for some time that the clock stops afterwards.
    """
    if state.mode is DISCONNECTED:
        return 0.0
    kept = 1.0 - min(request.elapsed / AVERAGING_TIME, 1.0)
    return max(state.drift * kept + request.elapsed - dt, 0.0)
