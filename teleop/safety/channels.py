"""Check one measured channel for range, age, rate of change and frozen values."""

from __future__ import annotations

import math
from typing import NamedTuple

from teleop.safety.events import Fault
from teleop.safety.limits import ChannelLimits

MIN_INTERVAL = 1e-3
"""Shortest time that is used to compute the rate of change between two samples [s].

With a shorter time, measurement noise alone could exceed `max_rate`.
"""
SAME_SAMPLE = 1e-6
"""Largest difference between two sampling times that are treated as equal [s].

A sample that is read twice is not a sign of a frozen sensor.
"""


class ChannelState(NamedTuple):
    """State of the check of one channel, which is passed from one tick to the next."""

    value: float = math.nan
    """Latest value, in the channel's SI unit; NaN before the first sample."""
    sampled: float = math.nan
    """Sampling time of the latest sample [s]."""
    changed: float = math.nan
    """Time of the latest tick at which the value changed [s]."""
    travel: float = 0.0
    """Sum of the commanded changes since the tick at which the measured value last changed, in the
    channel's SI unit."""


new_state = tuple.__new__
"""Constructor of `ChannelState` from a tuple; it takes half the time of `ChannelState(...)`."""


class DetectedFault(NamedTuple):
    """A detected fault, with its source, the measured value and the exceeded limit."""

    fault: Fault
    """Kind of fault."""
    source: str
    """Channel or part with the fault, or a text that describes the fault."""
    value: float
    """Measured value, in SI units; NaN if the fault has no value."""
    limit: float
    """Limit that the value exceeds, in SI units; NaN if the fault has no limit."""
    since: float
    """Time at which the fault began [s]."""


def check_channel(
    name: str,
    last: ChannelState,
    value: float,
    age: float,
    now: float,
    travel: float,
    limits: ChannelLimits,
) -> tuple[ChannelState, DetectedFault | None]:
    """Check a sample against the limits of its channel.

    Parameters
    ----------
    name
        Name of the channel.
    last
        State of the check after the previous tick.
    value, age
        The sample, in the channel's SI unit, and its age [s].
    now
        Time of the tick [s].
    travel
        Magnitude of the commanded change of the value since the previous tick, in the channel's
        SI unit.
    limits
        Limits of the channel.

    Returns
    -------
    state
        State of the check after this tick; unchanged if there is a fault.
    fault
        The fault that was detected, or None.
    """
    if not limits.low <= value <= limits.high:
        if value != value:
            if not limits.required and math.isnan(last.value):
                return last, None
            return last, DetectedFault(Fault.NOT_A_NUMBER, name, value, math.nan, now)
        if math.isinf(value):
            return last, DetectedFault(Fault.INFINITE, name, value, math.nan, now)
        limit = limits.high if value > limits.high else limits.low
        return last, DetectedFault(Fault.OUT_OF_RANGE, name, value, limit, now)
    if not abs(age) <= limits.max_age:
        return last, DetectedFault(Fault.STALE, name, age, limits.max_age, now - age)
    sampled = now - age
    if value != last.value:
        step, interval = abs(value - last.value), sampled - last.sampled
        possible = limits.max_rate * (interval if interval > MIN_INTERVAL else MIN_INTERVAL)
        if step > possible:
            return last, DetectedFault(Fault.JUMP, name, step, possible, now)
        return new_state(ChannelState, (value, sampled, now, 0.0)), None
    travel += last.travel
    if sampled - last.sampled > SAME_SAMPLE:
        if now - last.changed > limits.frozen_time:
            return last, DetectedFault(Fault.FROZEN, name, value, limits.frozen_time, last.changed)
        if travel > limits.frozen_travel:
            return last, DetectedFault(
                Fault.FROZEN, name, value, limits.frozen_travel, last.changed
            )
    return new_state(ChannelState, (value, sampled, last.changed, travel)), None
