"""The check of one channel: age, range, impossible jump, frozen value."""

from __future__ import annotations

import math
from typing import NamedTuple

from teleop.safety.events import Fault
from teleop.safety.limits import ChannelLimits

SHORTEST = 1e-3
"""A change is judged over at least this time [s]: noise does not grow with the rate."""
SAME_SAMPLE = 1e-6
"""Two samples this close in time [s] are one that was read twice, which is not yet frozen."""


class Watch(NamedTuple):
    """What is remembered of a channel."""

    value: float = math.nan
    sampled: float = math.nan
    """When that value was sampled [s]."""
    changed: float = math.nan
    """When the value was first seen [s]."""
    travel: float = 0.0
    """How far the drive has been commanded to change it since."""


class Trip(NamedTuple):
    """A fault, and the numbers that go with it."""

    fault: Fault
    source: str
    value: float
    limit: float
    since: float


def check_channel(
    name: str,
    watch: Watch,
    value: float,
    age: float,
    now: float,
    travel: float,
    limits: ChannelLimits,
) -> tuple[Watch, Trip | None]:
    """Hold a sample against its channel's limits.

    Parameters
    ----------
    name
        The channel.
    watch
        What is remembered of it.
    value, age
        The sample and its age [s].
    now
        Time of the tick [s].
    travel
        How far the drive was commanded to change the channel since the last tick.
    limits
        What is healthy.
    """
    if not limits.low <= value <= limits.high:
        if value != value:
            if not limits.required and math.isnan(watch.value):
                return watch, None
            return watch, Trip(Fault.NOT_A_NUMBER, name, value, math.nan, now)
        if math.isinf(value):
            return watch, Trip(Fault.INFINITE, name, value, math.nan, now)
        limit = limits.high if value > limits.high else limits.low
        return watch, Trip(Fault.OUT_OF_RANGE, name, value, limit, now)
    if not abs(age) <= limits.max_age:
        return watch, Trip(Fault.STALE, name, age, limits.max_age, now - age)
    sampled = now - age
    if value != watch.value:
        step = abs(value - watch.value)
        possible = limits.max_rate * max(sampled - watch.sampled, SHORTEST)
        if step > possible:
            return watch, Trip(Fault.JUMP, name, step, possible, now)
        return Watch(value, sampled, now), None
    travel += watch.travel
    if sampled - watch.sampled > SAME_SAMPLE:
        if now - watch.changed > limits.frozen_time:
            return watch, Trip(Fault.FROZEN, name, value, limits.frozen_time, watch.changed)
        if travel > limits.frozen_travel:
            return watch, Trip(Fault.FROZEN, name, value, limits.frozen_travel, watch.changed)
    return Watch(value, sampled, watch.changed, travel), None
