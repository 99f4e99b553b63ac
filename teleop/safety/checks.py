"""Checks that the safety supervisor makes at each tick."""

from __future__ import annotations

import math

from drivers import CHANNELS, Command, Measurement
from teleop.safety.channels import DetectedFault
from teleop.safety.events import DISCONNECTED, Fault
from teleop.safety.limits import Limits
from teleop.safety.state import Request, Supervision

CONTACT_FORCE = CHANNELS.index("contact_force")
GAIN_ERROR = 0.05
"""Allowed gain error of a drive, as a fraction of the commanded travel."""
AVERAGING_TIME = 1.0
"""Averaging time for the fraction of skipped periods and for the drift of the rig's clock [s]."""


def check_motion(
    measurement: Measurement,
    dt: float,
    following_error: float,
    skipped_fraction: float,
    drift: float,
    limits: Limits,
) -> list[DetectedFault]:
    """Return faults: errors of the rig, wrong timing of the loop, and exceeded hard limits.

    Each of these faults stops the drives without a ramp, even if the slave moves.

    Parameters
    ----------
    measurement
        Measurement of this tick.
    dt
        Time since the previous tick [s].
    following_error
        Following error of the slave: commanded minus measured travel [m].
    skipped_fraction
        Fraction of periods that the loop has skipped, averaged over about `AVERAGING_TIME`.
    drift
        Time by which the rig's clock is behind the clock of the loop [s].
    limits
        Limits of rig and channels.
    """
    faults = check_rig(measurement)
    faults += check_loop(measurement.time, dt, skipped_fraction, drift, limits)
    faults += check_limits(measurement, following_error, limits)
    return faults


def check_rig(measurement: Measurement) -> list[DetectedFault]:
    """Return the faults that the rig reports: an emergency stop and an error of a drive."""
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
    """Return the faults in the timing of the control loop and of the measurements.

    Parameters
    ----------
    now
        Time of this measurement [s].
    dt
        Time since the previous measurement [s].
    skipped_fraction
        Fraction of periods that the loop has skipped, averaged over about `AVERAGING_TIME`.
    drift
        Time by which the rig's clock is behind the clock of the loop [s].
    limits
        Limits of rig and channels.
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

    Parameters
    ----------
    measurement
        Measurement of this tick.
    following_error
        Following error of the slave: commanded minus measured travel [m].
    limits
        Limits of rig and channels.
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


def check_command(desired: Command, now: float) -> list[DetectedFault]:
    """Return a fault if a velocity of the desired command is infinite or NaN."""
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
) -> float:
    """Return the following error of the slave after this tick [m].

    The following error is the commanded travel minus the measured travel. From this difference,
    the function subtracts the part that the compliance of the drive and an allowed gain error
    (`GAIN_ERROR`) can cause. If `dt` is negative or larger than `max_gap`, it is not known how far
    the slave was commanded to move. The following error then keeps its value of the previous tick.

    Parameters
    ----------
    state
        State of the supervisor after the previous tick.
    measurement
        Measurement of this tick.
    dt
        Time since the previous tick [s].
    limits
        Limits of rig and channels.
    """
    before = state.position
    if before != before:
        return 0.0
    if not 0.0 <= dt <= limits.max_gap:
        return state.following_error
    travel = state.applied[1] * dt
    error = state.following_error + travel - (measurement.slave_position - before)
    pressed = measurement.contact_force - state.channel_states[CONTACT_FORCE].value
    if pressed == pressed:
        error -= limits.drive_compliance * pressed
    tolerated = min(GAIN_ERROR * abs(travel), abs(error))
    return error - math.copysign(tolerated, error)


def update_skipped_fraction(state: Supervision, request: Request, dt: float) -> float:
    """Return the fraction of periods that the loop skips, averaged over `AVERAGING_TIME`."""
    fraction = request.skipped / (request.skipped + 1.0)
    weight = min(max(dt, 0.0) / AVERAGING_TIME, 1.0)
    return state.skipped_fraction + (fraction - state.skipped_fraction) * weight


def update_clock_drift(state: Supervision, request: Request, dt: float, limits: Limits) -> float:
    """Return the time [s] by which the rig's clock fell behind the loop's clock.

    The result depends only on about the last `AVERAGING_TIME` seconds. If the rig's clock jumps
    forward, the result is negative, but not smaller than -`max_gap`. Because of this bound,
    `check_loop` also detects a clock that stops after a forward jump.
    """
    if state.mode is DISCONNECTED:
        return 0.0
    kept = 1.0 - min(request.elapsed / AVERAGING_TIME, 1.0)
    return max(state.drift * kept + request.elapsed - dt, -limits.max_gap)
