"""Define the interface of a rig, which is a real or simulated telemanipulator.

With this interface the controller reads the sensors, commands velocities, and stops the drives.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import TracebackType
from typing import Annotated, ClassVar, NamedTuple, Self, get_origin, get_type_hints

new_tuple = tuple.__new__
"""Constructor of a NamedTuple from a tuple of all its values: `new_tuple(Command, (u, w))`.

This takes a third of the time of `Command(u, w)`. It is used for objects that are created at each
tick of the control loop.
"""


class RigError(Exception):
    """A device failed or sends no data. The message names the device and what was expected."""


LONGEST_STOP = 0.5
"""Longest time from the first call of `Rig.idle` until all drives confirm that they are out of
operation [s]."""


class NotStoppedError(RigError):
    """A drive does not confirm that it is out of operation. The message names the drive."""


def reason(error: Exception) -> str:
    """Return the cause of an error as one line of text that can be part of a message.

    Parameters
    ----------
    error
        Error that the operating system or a library raised.
    """
    number = getattr(error, "errno", None)
    text = os.strerror(number).lower() if number else str(error)
    return " ".join(text.split()).rstrip(".") or type(error).__name__


Force = Annotated[float, "N"]
Position = Annotated[float, "m"]
Velocity = Annotated[float, "m/s"]


class Ages(NamedTuple):
    """Age of the latest sample of each channel [s].

    The age is the time since the sample was taken. The fields have the order of `CHANNELS`.
    """

    master_force: float
    master_position: float
    slave_position: float
    contact_force: float
    slave_velocity: float


class Measurement(NamedTuple):
    """Latest samples of all channels of a rig at one tick of the control loop, in SI units.

    A channel is a measured quantity. The fields with the types `Force`, `Position` and `Velocity`
    are the channels. `CHANNELS` contains their names, and `UNITS` their units. If the rig does not
    measure a channel, the value of this channel is NaN.

    Positions are displacements from the contact datum (the zero position). They are positive toward
    the environment (the specimen). Forces are positive in compression.
    """

    time: float
    """Time at which the rig was read [s], on the controller's clock."""
    master_force: Force
    """Force of the operator's hand on the handle [N]."""
    master_position: Position
    """Position of the handle [m]."""
    slave_position: Position
    """Position of the slave [m]."""
    contact_force: Force
    """Force between slave and environment [N]."""
    slave_velocity: Velocity
    """Velocity of the slave that its drive reports [m/s]; NaN if the drive does not report it."""
    age: Ages
    """Ages of the samples [s]."""
    drive_error: str = ""
    """Error that a device of the rig reports, as text; empty if there is no error."""
    emergency_stop: bool = False
    """Whether the emergency-stop input of the rig is open."""

    @property
    def channels(self) -> tuple[float, ...]:
        """Values of the channels, in the order of `CHANNELS`."""
        return self[1:6]


UNITS = {
    name: kind.__metadata__[0]
    for name, kind in get_type_hints(Measurement, include_extras=True).items()
    if get_origin(kind) is Annotated
}
"""SI unit of each measured channel."""
CHANNELS = tuple(UNITS)
"""Names of the measured channels, in the order of the fields of `Measurement`."""


class Command(NamedTuple):
    """Velocities of the two drives [m/s], positive in the direction of increasing position.

    The master is the handle. If it has no drive, `master_velocity` has no effect.
    """

    master_velocity: float
    slave_velocity: float


AXES = tuple(name.removesuffix("_velocity") for name in Command._fields)
"""Names of the drives, in the order of a `Command`."""
STANDSTILL = Command(0.0, 0.0)


class Rig(ABC):
    """A telemanipulator, real or simulated.

    A rig is a context manager. On entry the rig is opened. On every exit the drives are taken out
    of operation, and then the rig is closed. If the drives have not confirmed that they are out of
    operation, `close` repeats the request for a limited time. When a drive is in operation, its
    watchdog is active. The watchdog stops the drive if no more commands arrive, for example because
    the process was killed.
    """

    virtual_time: ClassVar[bool] = False
    """Whether trials may run in virtual time, because the rig moves nothing real. Such a class is
    created with a function that returns the virtual time [s]."""

    @property
    def rejected(self) -> Mapping[str, Mapping[str, int]]:
        """Number of rejected messages of each device, for each reason of rejection.

        For example, `rejected["handle"]["checksum"]` is the number of messages of the device
        `handle` with a wrong checksum. Devices without rejected messages are omitted.
        """
        return {}

    @abstractmethod
    def open(self) -> None:
        """Connect to the devices. The drives do not move.

        Raises
        ------
        RigError
            A connection failed, or a device does not answer as expected.
        """

    @abstractmethod
    def read(self) -> Measurement:
        """Return the latest sample of every channel, without waiting for a new one.

        Raises
        ------
        RigError
            A device cannot be read.
        """

    @abstractmethod
    def enable(self) -> bool:
        """Request that all drives go into operation with zero velocity.

        In operation, the watchdogs of the drives are active. This method is called once per tick
        until it returns True.

        Returns
        -------
        bool
            Whether all drives are in operation.

        Raises
        ------
        RigError
            A drive does not go into operation, or cannot be commanded.
        """

    def rearm(self) -> None:  # noqa: B027
        """Clear the latched errors of the drives.

        A latched error is reported until it is cleared. This method is called only if a person
        requests it. If the cause of an error is still present, the error is reported again.
        """

    @abstractmethod
    def write(self, command: Command) -> Command:
        """Command velocities to the drives.

        Parameters
        ----------
        command
            Wanted velocities [m/s].

        Returns
        -------
        Command
            Velocities after the limitation to the range of each drive [m/s]. The drives receive
            these velocities.

        Raises
        ------
        ValueError
            A velocity is not finite. In this case no command was sent.
        RigError
            A drive cannot be commanded.
        """

    @abstractmethod
    def idle(self) -> bool:
        """Take the drives out of operation immediately; return whether they have confirmed it.

        This method is called once per tick until it returns True, and no other command is sent in
        this time. It may be called in any state of the drives.

        Returns
        -------
        bool
            Whether all drives have reported that they are out of operation. A rig whose drives
            report nothing returns True.

        Raises
        ------
        RigError
            A drive cannot be commanded, or does not confirm in time.
        """

    @abstractmethod
    def close(self) -> None:
        """Release the devices. This method may also be called after `open` failed.

        Raises
        ------
        RigError
            A drive does not confirm that it is out of operation. The devices are released anyway.
        """

    def __enter__(self) -> Self:
        try:
            self.open()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.idle()
        finally:
            self.close()
