"""Faults of sensors and drives, put between any rig and its controller from a moment on."""

from __future__ import annotations

import math
from abc import ABC
from dataclasses import dataclass
from typing import Any

from drivers import STANDSTILL, Command, Measurement, Rig, RigError


class RigFault(ABC):  # noqa: B024
    """What a fault does to what is read and to what is commanded; by itself nothing."""

    def read(self, measurement: Measurement) -> Measurement:
        """What the controller is given instead."""
        return measurement

    def command(self, command: Command) -> Command:
        """What the drives are given instead."""
        return command


def with_channel(measurement: Measurement, channel: str, value: float) -> Measurement:
    """The measurement with another value of a channel."""
    changes: dict[str, Any] = {channel: value}
    return measurement._replace(**changes)


@dataclass
class Replaced(RigFault):
    """A channel reads this value."""

    channel: str
    value: float

    def read(self, measurement: Measurement) -> Measurement:
        """The value in place of the sample."""
        return with_channel(measurement, self.channel, self.value)


@dataclass
class Shifted(RigFault):
    """A channel reads this much more, and ever more at this rate."""

    channel: str
    step: float
    rate: float = 0.0
    """[unit/s]"""

    def __post_init__(self) -> None:
        self._start = math.nan

    def read(self, measurement: Measurement) -> Measurement:
        """The sample, shifted."""
        if math.isnan(self._start):
            self._start = measurement.time
        shift = self.step + self.rate * (measurement.time - self._start)
        value = getattr(measurement, self.channel) + shift
        return with_channel(measurement, self.channel, value)


class Frozen(RigFault):
    """A channel repeats its value, fresh or, where it says so, ever older.

    Parameters
    ----------
    channel
        The channel.
    ageing
        Whether its age grows, as behind a cable that came out, or the sensor goes on sending.
    """

    def __init__(self, channel: str, ageing: bool) -> None:
        self._channel, self._ageing = channel, ageing
        self._value = self._start = math.nan

    def read(self, measurement: Measurement) -> Measurement:
        """The first sample again."""
        if math.isnan(self._start):
            self._value, self._start = getattr(measurement, self._channel), measurement.time
        age = measurement.age
        if self._ageing:
            age = age._replace(**{self._channel: measurement.time - self._start})
        return with_channel(measurement, self._channel, self._value)._replace(age=age)


@dataclass
class Reported(RigFault):
    """The rig reports an error of a drive, or that its emergency-stop input is open."""

    drive_error: str = ""
    emergency_stop: bool = False

    def read(self, measurement: Measurement) -> Measurement:
        """The sample with the report."""
        return measurement._replace(
            drive_error=self.drive_error, emergency_stop=self.emergency_stop
        )


@dataclass
class Runaway(RigFault):
    """The slave's drive goes this much faster than it is told [m/s], until it is idled."""

    velocity: float

    def command(self, command: Command) -> Command:
        """The command, and what the drive adds."""
        return command._replace(slave_velocity=command.slave_velocity + self.velocity)


class Unplugged(RigFault):
    """Nothing can be read."""

    def read(self, measurement: Measurement) -> Measurement:
        """RigError."""
        raise RigError("master board: no answer, expected a frame each millisecond")


class FaultyRig(Rig):
    """Another rig, with a fault from the moment of `inject` on.

    Parameters
    ----------
    rig
        The rig.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._fault = RigFault()
        self._enabled = False

    def inject(self, fault: RigFault) -> None:
        """Let this fault set in."""
        self._fault = fault

    def open(self) -> None:
        """Open the rig."""
        self.rig.open()

    def read(self) -> Measurement:
        """What the fault makes of the rig's measurement."""
        return self._fault.read(self.rig.read())

    def rearm(self) -> None:
        """Let the rig forget its errors."""
        self.rig.rearm()

    def enable(self) -> bool:
        """Enable the drives."""
        self._enabled = self.rig.enable()
        return self._enabled

    def write(self, command: Command) -> Command:
        """Command the drives what the fault makes of it; tells what the drives would tell."""
        if not self._enabled:
            return self.rig.write(STANDSTILL)
        self.rig.write(self._fault.command(command))
        return command

    def idle(self) -> None:
        """Idle the drives."""
        self._enabled = False
        self.rig.idle()

    def close(self) -> None:
        """Close the rig."""
        self.rig.close()
