"""Inject sensor and drive faults between a rig and its controller."""

from __future__ import annotations

import math
from abc import ABC
from dataclasses import dataclass
from typing import Any

from drivers import STANDSTILL, Command, Measurement, Rig, RigError


class RigFault(ABC):  # noqa: B024
    """Base class of faults, which change measurements or commands. This class changes nothing."""

    def read(self, measurement: Measurement) -> Measurement:
        """Return the measurement that the controller receives."""
        return measurement

    def command(self, command: Command) -> Command:
        """Return the command that the drives receive."""
        return command


def with_channel(measurement: Measurement, channel: str, value: float) -> Measurement:
    """Return a copy of the measurement in which one channel has another value, in SI units."""
    changes: dict[str, Any] = {channel: value}
    return measurement._replace(**changes)


@dataclass
class Replaced(RigFault):
    """Fault: a channel of the measurement has a constant value."""

    channel: str
    """Name of the channel."""
    value: float
    """Value, in the SI unit of the channel."""

    def read(self, measurement: Measurement) -> Measurement:
        """Return the measurement with the constant value in the channel."""
        return with_channel(measurement, self.channel, self.value)


@dataclass
class Shifted(RigFault):
    """Fault: a channel of the measurement has an additional offset and a drift."""

    channel: str
    """Name of the channel."""
    step: float
    """Offset, in the SI unit of the channel."""
    rate: float = 0.0
    """Drift, in the SI unit of the channel per second."""

    def __post_init__(self) -> None:
        self._start = math.nan

    def read(self, measurement: Measurement) -> Measurement:
        """Return the measurement with offset and drift added to the channel."""
        if math.isnan(self._start):
            self._start = measurement.time
        shift = self.step + self.rate * (measurement.time - self._start)
        value = getattr(measurement, self.channel) + shift
        return with_channel(measurement, self.channel, value)


class Frozen(RigFault):
    """Fault: a channel of the measurement keeps the value that it had when the fault began.

    Parameters
    ----------
    channel
        Name of the channel.
    ageing
        Whether the age of the value increases, as after a cable was disconnected. If not, the age
        of the new measurements is used, as for a sensor that sends the same value again and again.
    """

    def __init__(self, channel: str, ageing: bool) -> None:
        self._channel, self._ageing = channel, ageing
        self._value = self._start = math.nan

    def read(self, measurement: Measurement) -> Measurement:
        """Return the measurement with the value that the channel had when the fault began."""
        if math.isnan(self._start):
            self._value, self._start = getattr(measurement, self._channel), measurement.time
        age = measurement.age
        if self._ageing:
            age = age._replace(**{self._channel: measurement.time - self._start})
        return with_channel(measurement, self._channel, self._value)._replace(age=age)


@dataclass
class Reported(RigFault):
    """Fault: the measurement contains a drive error or an open emergency-stop input."""

    drive_error: str = ""
    """Text of the drive error; empty for none."""
    emergency_stop: bool = False
    """Whether the emergency-stop input is open."""

    def read(self, measurement: Measurement) -> Measurement:
        """Return the measurement with the drive error and the state of the emergency-stop input."""
        return measurement._replace(
            drive_error=self.drive_error, emergency_stop=self.emergency_stop
        )


@dataclass
class Runaway(RigFault):
    """Fault: the drive of the slave moves faster than commanded until it is disabled."""

    velocity: float
    """Velocity that is added to the command [m/s]."""

    def command(self, command: Command) -> Command:
        """Return the command with the additional velocity of the slave."""
        return command._replace(slave_velocity=command.slave_velocity + self.velocity)


class Unplugged(RigFault):
    """Fault: no measurement can be read from the rig."""

    def read(self, measurement: Measurement) -> Measurement:
        """Raise RigError, as the driver of a disconnected board does."""
        raise RigError("master board: no answer, expected a frame each millisecond")


class FaultyRig(Rig):
    """A rig with a fault. The fault is active from the call of `inject` on.

    Parameters
    ----------
    rig
        The rig without fault.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._fault = RigFault()
        self._enabled = False

    def inject(self, fault: RigFault) -> None:
        """Activate a fault. It replaces the present fault, if there is one."""
        self._fault = fault

    def open(self) -> None:
        """Open the rig."""
        self.rig.open()

    def read(self) -> Measurement:
        """Return the measurement of the rig, changed by the fault."""
        return self._fault.read(self.rig.read())

    def rearm(self) -> None:
        """Clear the latched errors of the rig."""
        self.rig.rearm()

    def enable(self) -> bool:
        """Request the rig to enable the drives; return whether they are enabled."""
        self._enabled = self.rig.enable()
        return self._enabled

    def write(self, command: Command) -> Command:
        """Send the command, changed by the fault, to the drives; return the unchanged command.

        Before the drives are enabled, zero velocity is sent and returned instead.
        """
        if not self._enabled:
            return self.rig.write(STANDSTILL)
        self.rig.write(self._fault.command(command))
        return command

    def idle(self) -> None:
        """Disable the drives."""
        self._enabled = False
        self.rig.idle()

    def close(self) -> None:
        """Close the rig."""
        self.rig.close()
