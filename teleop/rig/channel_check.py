"""The check of a rig: every channel as it comes in, and the round trip to each device."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from drivers import CHANNELS
from drivers.rig_file import RigFile
from drivers.wired_rig import WiredRig
from teleop.control.clock import Clock
from teleop.rig.drive_check import DriveReport
from teleop.safety import ChannelLimits
from teleop.safety.rig_limits import rig_limits

NEAR_END = 0.98
"""Share of a channel's range beyond which a sample counts as saturated."""
PINGS = 20
"""Round trips that are timed."""
ANSWER = 0.5
"""Longest wait for an answer [s]."""


class ChannelReport(NamedTuple):
    """What came in on a channel; values in its SI unit."""

    name: str
    source: str
    rate_hz: float
    """Of the samples, by the median time between two."""
    jitter_s: float
    """Standard deviation of that time."""
    age_s: float
    """Median age at a tick."""
    oldest_s: float
    """Greatest age at a tick."""
    mean: float
    noise: float
    """Standard deviation."""
    saturated: float
    """Share of samples near the ends of the range, or beyond."""
    problem: str
    """What the supervisor would trip on; empty for nothing."""


def problems(channels: Sequence[ChannelReport], drives: Sequence[DriveReport]) -> list[str]:
    """All that is wrong, each with its channel or drive."""
    parts: list[ChannelReport | DriveReport] = [*channels, *drives]
    return [f"{part.name}: {part.problem}" for part in parts if part.problem]


def listen(
    rig: WiredRig, clock: Clock, seconds: float, show: Callable[[list[ChannelReport]], None]
) -> list[ChannelReport]:
    """Read an opened rig for a while and tell of every channel.

    Parameters
    ----------
    rig
        The rig, opened; its drives stay idle.
    clock
        What paces the reading.
    seconds
        How long [s].
    show
        Told what is known so far, four times a second.
    """
    limits = rig_limits(rig.file.sections).channels
    logs = {name: Log() for name, _ in rig.file.sections.channels.items()}
    sources = [(log, CHANNELS.index(name)) for name, log in logs.items()]
    start = clock.now()
    shown = start
    while (now := clock.now()) - start < seconds:
        clock.wait()
        measurement = rig.read()
        values = measurement.channels
        for log, index in sources:
            log.add(measurement.time, values[index], measurement.age[index])
        if now - shown > 0.25:
            shown = now
            show([log.report(name, rig.file, limits[name]) for name, log in logs.items()])
    return [log.report(name, rig.file, limits[name]) for name, log in logs.items()]


class Log:
    """The samples of a channel."""

    def __init__(self) -> None:
        self._values: list[float] = []
        self._times: list[float] = []
        self._ages: list[float] = []

    def add(self, now: float, value: float, age: float) -> None:
        """Take in what a tick has read."""
        self._ages.append(age)
        if not self._times or now - age - self._times[-1] > 1e-6:
            self._times.append(now - age)
            self._values.append(value)

    def report(self, name: str, rig: RigFile, limits: ChannelLimits) -> ChannelReport:
        """What they come to."""
        values, intervals = np.array(self._values), np.diff(self._times)
        channel = dict(rig.sections.channels.items())[name]
        middle, half = 0.5 * (limits.low + limits.high), 0.5 * (limits.high - limits.low)
        saturated = float(np.mean(np.abs(values - middle) > NEAR_END * half))
        return ChannelReport(
            name,
            f"{channel.device}.{channel.signal}",
            1.0 / float(np.median(intervals)) if len(intervals) else 0.0,
            float(np.std(intervals)) if len(intervals) else math.nan,
            statistics.median(self._ages),
            max(self._ages),
            float(np.mean(values)),
            float(np.std(values)),
            saturated,
            channel_problem(values, max(self._ages), saturated, limits),
        )


def channel_problem(
    values: np.ndarray[tuple[int], np.dtype[np.float64]],
    oldest: float,
    saturated: float,
    limits: ChannelLimits,
) -> str:
    """What is wrong with a channel at rest."""
    if oldest > limits.max_age:
        return f"{oldest * 1e3:.1f} ms old, limit {limits.max_age * 1e3:g} ms"
    if saturated:
        return f"{saturated:.0%} of the samples at the end of the range"
    if limits.frozen_time < math.inf and len(values) > 1 and not np.ptp(values):
        return "the value never changes"
    return ""


def round_trips(rig: WiredRig, clock: Clock) -> Iterator[tuple[str, float]]:
    """Median time from a question to its answer [s] of each device that can be asked."""
    for name, device in rig.devices.items():
        times = []
        for _ in range(PINGS):
            if not device.ping():
                break
            sent = clock.now()
            bus = rig.buses[device.settings.bus]
            while not device.answered() and clock.now() - sent < ANSWER:
                bus.poll()
            times.append(clock.now() - sent)
            time.sleep(1e-3)
        if times:
            yield name, statistics.median(times)
