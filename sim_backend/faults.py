"""Simulated faults of sensors and drives, to test how the controller reacts to them.

A `FaultyRig` is used between the controller and a rig (a real or simulated telemanipulator). It
changes the measurements that the controller receives, or the commands that the drives receive.
"""

from __future__ import annotations

import math
from abc import ABC
from dataclasses import dataclass
from typing import Any

from drivers import STANDSTILL, Command, Measurement, Rig, RigError


class RigFault(ABC):  # noqa: B024
    """Base class of faults of a rig. A fault changes measurements or commands.

    The methods of this class return their argument unchanged. Subclasses override them.
    """

    def read(self, measurement: Measurement) -> Measurement:
        """Return the measurement that the controller receives instead of `measurement`."""
        return measurement

    def command(self, command: Command) -> Command:
        """Return the velocity command that the drives receive instead of `command`."""
        return command


def with_channel(measurement: Measurement, channel: str, value: float) -> Measurement:
    """Return a copy of the measurement in which one measured quantity has another value.

    `channel` is the name of this quantity, for example `contact_force`. `value` is the new value in
    SI units.
    """
    changes: dict[str, Any] = {channel: value}
    return measurement._replace(**changes)


@dataclass
class Replaced(RigFault):
    """Fault: the value of a channel is replaced by a constant."""

    channel: str
    """Name of the channel."""
    value: float
    """The constant, in the SI unit of the channel."""

    def read(self, measurement: Measurement) -> Measurement:
        """Return a copy of the measurement in which one measured quantity has a constant value."""
        return with_channel(measurement, self.channel, self.value)


@dataclass
class Shifted(RigFault):
    """Fault: an offset and a drift are added to the value of a channel."""

    channel: str
    """Name of the channel."""
    step: float
    """Constant offset, in the SI unit of the channel."""
    rate: float = 0.0
    """Change of the added value per second (drift), in the SI unit of the channel per second."""

    def __post_init__(self) -> None:
        self._start = math.nan

    def read(self, measurement: Measurement) -> Measurement:
        """Return a copy of the measurement with offset and drift added to one measured quantity."""
        if math.isnan(self._start):
            self._start = measurement.time
        shift = self.step + self.rate * (measurement.time - self._start)
        value = getattr(measurement, self.channel) + shift
        return with_channel(measurement, self.channel, value)


class Frozen(RigFault):
    """Fault: the value of a channel does not change after the fault began."""

    def __init__(self, channel: str, ageing: bool) -> None:
        self._channel, self._ageing = channel, ageing
        self._value = self._start = math.nan

    def read(self, measurement: Measurement) -> Measurement:
        """Return a copy of the measurement in which one measured quantity keeps its first value.

        The first value is that of the first call of this method, when the fault began.
        """
        if math.isnan(self._start):
            self._value, self._start = getattr(measurement, self._channel), measurement.time
        age = measurement.age
        if self._ageing:
            age = age._replace(**{self._channel: measurement.time - self._start})
        return with_channel(measurement, self._channel, self._value)._replace(age=age)


@dataclass
class Reported(RigFault):
    """Fault: the rig reports a drive error or an open emergency-stop input."""

    drive_error: str = ""
    """Text of the drive error; empty if there is no drive error."""
    emergency_stop: bool = False
    """Whether the emergency-stop input is open."""

    def read(self, measurement: Measurement) -> Measurement:
        """Return a copy of the measurement with `drive_error` and `emergency_stop` of the fault."""
        return measurement._replace(
            drive_error=self.drive_error, emergency_stop=self.emergency_stop
        )


@dataclass
class Runaway(RigFault):
    """Fault: the drive of the slave moves faster than commanded, until the drives are disabled."""

    velocity: float
    """Velocity that is added to the velocity command of the slave [m/s]."""

    def command(self, command: Command) -> Command:
        """Return a copy of the command with `velocity` added to the velocity of the slave."""
        return command._replace(slave_velocity=command.slave_velocity + self.velocity)


@dataclass
class Disobedient(RigFault):
    """Fault: the drive of the slave moves at a constant velocity, and does not obey a stop."""

    velocity: float
    """Velocity of the slave [m/s]."""
    confirms: bool = False
    """Whether the drives nevertheless report that they are disabled."""

    def command(self, command: Command) -> Command:
        """Return a copy of the command with the velocity of the fault for the slave."""
        return command._replace(slave_velocity=self.velocity)


class Unplugged(RigFault):
    """Fault: no measurement can be read from the rig, as if a device were disconnected."""

    def read(self, measurement: Measurement) -> Measurement:
        """Raise a `RigError` at each reading. The driver of a disconnected device does the same."""
        raise RigError("master board: no answer, expected a frame each millisecond")


class FaultyRig(Rig):
    """A rig (telemanipulator with sensors and drives) for which a test can simulate a fault.

    Before the first call of `inject`, there is no fault.

    Parameters
    ----------
    rig
        The rig without fault, whose measurements and commands are changed.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._fault = RigFault()
        self._enabled = False

    def inject(self, fault: RigFault) -> None:
        """Activate a fault from now on. If another fault is active, the new fault replaces it."""
        self._fault = fault

    def open(self) -> None:
        """Connect to the devices of the rig."""
        self.rig.open()

    def read(self) -> Measurement:
        """Return the measurement of the rig, changed by the active fault."""
        if isinstance(self._fault, Disobedient):
            self.rig.write(self._fault.command(STANDSTILL))
        return self._fault.read(self.rig.read())

    def rearm(self) -> None:
        """Clear the latched errors of the drives, which are reported until they are cleared."""
        self.rig.rearm()

    def enable(self) -> bool:
        """Request that all drives are enabled; return whether all drives are enabled."""
        self._enabled = self.rig.enable()
        return self._enabled

    def write(self, command: Command) -> Command:
        """Send the command, changed by the fault, to the drives; return the unchanged command.

        The caller therefore does not see the change in the result. While the drives are disabled,
        zero velocity is sent and returned instead.
        """
        if not (self._enabled or isinstance(self._fault, Disobedient)):
            return self.rig.write(STANDSTILL)
        self.rig.write(self._fault.command(command))
        return command

    def idle(self) -> bool:
        """Disable the drives; return whether they have confirmed it."""
        self._enabled = False
        if isinstance(self._fault, Disobedient):
            return self._fault.confirms
        return self.rig.idle()

    def close(self) -> None:
        """Disconnect from the devices of the rig."""
        self.rig.close()
