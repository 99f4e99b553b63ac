"""Check the sensor channels of a rig at rest, and measure the round-trip times to the devices."""

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
from teleop.rig.drive_report import DriveReport
from teleop.safety import ChannelLimits
from teleop.safety.rig_limits import rig_limits

NEAR_END = 0.98
"""Largest distance of a valid sample from the middle of the range, as a fraction of half the range.

A sample with a larger distance is treated as saturated.
"""
PINGS = 20
"""Number of round-trip times that are measured for each device."""
TIMEOUT = 0.5
"""Longest wait for the answer of a device to a ping [s]."""


class ChannelReport(NamedTuple):
    """Statistics of the samples of one sensor channel, for example of the contact force.

    `mean` and `noise` are in the SI unit of the measured quantity.
    """

    name: str
    """Name of the channel."""
    source: str
    """Device and signal of the channel, in the form DEVICE.SIGNAL."""
    rate_hz: float
    """Sampling rate, the inverse of the median time between samples [Hz]."""
    jitter_s: float
    """Standard deviation of the time between samples [s]."""
    age_s: float
    """Median over all ticks of the age of the latest sample [s]."""
    oldest_s: float
    """Maximum over all ticks of the age of the latest sample [s]."""
    mean: float
    """Mean of the samples."""
    noise: float
    """Standard deviation of the samples."""
    saturated: float
    """Fraction of the samples that are near or beyond the ends of the sensor's range."""
    problem: str
    """Problem for which the safety supervisor would stop a trial; empty if there is no problem."""


def list_problems(channels: Sequence[ChannelReport], drives: Sequence[DriveReport]) -> list[str]:
    """Return all problems of channels and drives, each with the name of the channel or drive."""
    parts: list[ChannelReport | DriveReport] = [*channels, *drives]
    return [f"{part.name}: {part.problem}" for part in parts if part.problem]


def listen(
    rig: WiredRig, clock: Clock, seconds: float, show: Callable[[list[ChannelReport]], None]
) -> list[ChannelReport]:
    """Read an open rig for some time, and return statistics of each sensor channel."""
    limits = rig_limits(rig.file.sections).channels
    logs = {name: ChannelLog() for name, _ in rig.file.sections.channels.items()}
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


class ChannelLog:
    """Stores the samples of one sensor channel, and computes their statistics."""

    def __init__(self) -> None:
        self._values: list[float] = []
        self._times: list[float] = []
        self._ages: list[float] = []

    def add(self, now: float, value: float, age: float) -> None:
        """Store the latest sample of the sensor at one tick.

        If this sample was already stored at an earlier tick, only its age is stored.
        """
        self._ages.append(age)
        if not self._times or now - age - self._times[-1] > 1e-6:
            self._times.append(now - age)
            self._values.append(value)

    def report(self, name: str, rig: RigFile, limits: ChannelLimits) -> ChannelReport:
        """Return the statistics of the samples that have been stored so far."""
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
    """Return a text that describes the problem of a sensor channel; empty if there is no problem.

    The rig must be at rest while the samples are taken.
    """
    if oldest > limits.max_age:
        return f"{oldest * 1e3:.1f} ms old, limit {limits.max_age * 1e3:g} ms"
    if saturated:
        return f"{saturated:.0%} of the samples at the end of the range"
    if limits.frozen_time < math.inf and len(values) > 1 and not np.ptp(values):
        return "the value never changes"
    return ""


def round_trips(rig: WiredRig, clock: Clock) -> Iterator[tuple[str, float]]:
    """Yield the name and the median round-trip time [s] of each device that supports a ping.

    A ping is a request that a device answers at once. The wait for an answer ends after `TIMEOUT`.
    If there is no answer by then, this wait counts as the round-trip time.
    """
    for name, device in rig.devices.items():
        times = []
        for _ in range(PINGS):
            if not device.ping():
                break
            sent = clock.now()
            bus = rig.buses[device.settings.bus]
            while not device.answered() and clock.now() - sent < TIMEOUT:
                bus.poll()
            times.append(clock.now() - sent)
            time.sleep(1e-3)
        if times:
            yield name, statistics.median(times)
