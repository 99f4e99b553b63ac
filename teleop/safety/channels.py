"""Check the samples of each channel: range, age, and rate of change.

A value that remains exactly the same for too long is also detected (a frozen value).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from drivers import CHANNELS, Measurement, new_tuple
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
    """Data of one channel that its check needs at the next tick."""

    value: float = math.nan
    """Latest value, in the channel's SI unit; NaN before the first sample."""
    sampled: float = math.nan
    """Sampling time of the latest sample [s]."""
    changed: float = math.nan
    """Time of the latest tick at which the value changed [s]."""
    travel: float = 0.0
    """Sum of the commanded changes since the tick at which the measured value last changed, in the
    channel's SI unit."""


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


def check_channels(
    states: Sequence[ChannelState],
    measurement: Measurement,
    travels: Sequence[float],
    limits: Mapping[str, ChannelLimits],
) -> tuple[tuple[ChannelState, ...], list[DetectedFault]]:
    """Check the sample of each channel against the limits of the channel.

    `travels` contains, for each channel, the change that the commands since the previous tick
    should cause, in the SI unit of the channel; 0 for a force. A value is frozen (a fault) if it
    remains the same although the sum of these changes is large. The state of a channel with a fault
    does not change.
    """
    now, faults = measurement.time, []
    new_states = []
    for name, state, value, age, travel in zip(
        CHANNELS, states, measurement.channels, measurement.age, travels, strict=True
    ):
        limit = limits[name]
        last, last_sampled, changed, last_travel = state
        fault = None
        if not (limit.low <= value <= limit.high and abs(age) <= limit.max_age):
            fault = invalid_sample(name, last, value, age, now, limit)
        elif value != last:
            sampled = now - age
            step, interval = abs(value - last), sampled - last_sampled
            possible = limit.max_rate * (interval if interval > MIN_INTERVAL else MIN_INTERVAL)
            if step > possible:
                fault = DetectedFault(Fault.JUMP, name, step, possible, now)
            else:
                state = new_tuple(ChannelState, (value, sampled, now, 0.0))
        else:
            sampled, travel = now - age, travel + last_travel
            is_new = sampled - last_sampled > SAME_SAMPLE
            if is_new and now - changed > limit.frozen_time:
                fault = DetectedFault(Fault.FROZEN, name, value, limit.frozen_time, changed)
            elif is_new and travel > limit.frozen_travel:
                fault = DetectedFault(Fault.FROZEN, name, value, limit.frozen_travel, changed)
            else:
                state = new_tuple(ChannelState, (value, sampled, changed, travel))
        if fault:
            faults.append(fault)
        new_states.append(state)
    return tuple(new_states), faults


def invalid_sample(
    name: str, last: float, value: float, age: float, now: float, limits: ChannelLimits
) -> DetectedFault | None:
    """Return the fault of a sample that is out of range, infinite, NaN or too old.

    The result is None if the value is NaN, the channel is not required, and the channel has never
    had a valid value (`last` is NaN). A rig without the sensor of this channel gives only such
    samples.
    """
    if limits.low <= value <= limits.high:
        return DetectedFault(Fault.STALE, name, age, limits.max_age, now - age)
    if value != value:
        if not limits.required and math.isnan(last):
            return None
        return DetectedFault(Fault.NOT_A_NUMBER, name, value, math.nan, now)
    if math.isinf(value):
        return DetectedFault(Fault.INFINITE, name, value, math.nan, now)
    limit = limits.high if value > limits.high else limits.low
    return DetectedFault(Fault.OUT_OF_RANGE, name, value, limit, now)
