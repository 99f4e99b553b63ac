"""Interface of a rig: channels to read, velocities to command, and a stop."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import TracebackType
from typing import Annotated, NamedTuple, Self, get_origin, get_type_hints


class RigError(Exception):
    """A device failed or does not send. The message has the device and the expectation."""


def reason(error: Exception) -> str:
    """Return the cause of an error of the system or of a library, as part of a line of text."""
    number = getattr(error, "errno", None)
    text = os.strerror(number).lower() if number else str(error)
    return " ".join(text.split()).rstrip(".") or type(error).__name__


Force = Annotated[float, "N"]
Position = Annotated[float, "m"]
Velocity = Annotated[float, "m/s"]


class Ages(NamedTuple):
    """Time [s] since the sample of each channel was taken, in the order of `CHANNELS`."""

    master_force: float
    master_position: float
    slave_position: float
    contact_force: float
    slave_velocity: float


class Measurement(NamedTuple):
    """All channels at one tick, in SI units.

    `CHANNELS` and `UNITS` are derived from the fields.

    Positions are displacements from the datum, positive into the environment; forces are
    positive in compression. A channel that the rig does not have is NaN.
    """

    time: float
    """Time when the rig was read [s], on the controller's clock."""
    master_force: Force
    """Force of the operator's hand on the handle [N]."""
    master_position: Position
    """Position of the handle [m]."""
    slave_position: Position
    """Position of the slave [m]."""
    contact_force: Force
    """Force between slave and environment [N]."""
    slave_velocity: Velocity
    """Velocity of the slave [m/s], if the drive reports it."""
    age: Ages
    """Ages of the samples [s]."""
    drive_error: str = ""
    """Error that a drive reports; empty for none."""
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
    """Velocities [m/s] of the two drives. A rig with a passive handle ignores the first."""

    master_velocity: float
    slave_velocity: float


AXES = tuple(name.removesuffix("_velocity") for name in Command._fields)
"""Names of the drives, in the order of a `Command`."""
STANDSTILL = Command(0.0, 0.0)


class Rig(ABC):
    """A telemanipulator, real or simulated.

    It is a context manager: on entry it is opened, and on every exit the drives are idled and it
    is closed. If the process is killed, the watchdogs of the drives, armed by `enable`, stop
    them.
    """

    @property
    def rejected(self) -> Mapping[str, Mapping[str, int]]:
        """Number of rejected frames by device and reason; devices without any are omitted."""
        return {}

    @abstractmethod
    def open(self) -> None:
        """Connect to the devices, without motion."""

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
        """Request operation of all drives at standstill, and arm their watchdogs.

        It is called once per tick until it returns True: all drives are in operation.

        Raises
        ------
        RigError
            A drive refuses.
        """

    def rearm(self) -> None:  # noqa: B027
        """Clear the latched errors of the drives, on request of a person.

        Errors that are still present are reported again.
        """

    @abstractmethod
    def write(self, command: Command) -> Command:
        """Command the drives, and return the applied command, limited to their ranges.

        Raises
        ------
        ValueError
            A velocity is not finite. No command was sent.
        RigError
            A drive cannot be commanded.
        """

    @abstractmethod
    def idle(self) -> None:
        """Take the drives out of operation immediately, in any state; may be called repeatedly."""

    @abstractmethod
    def close(self) -> None:
        """Release the devices, also after an `open` that failed."""

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
