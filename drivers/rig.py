"""What a rig is to the controller: channels to read, velocities to command, and a stop."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import TracebackType
from typing import Annotated, NamedTuple, Self, get_origin, get_type_hints


class RigError(Exception):
    """A device failed or fell silent; the message names which, and what was expected."""


def reason(error: Exception) -> str:
    """The cause of an error of the system or of a library, as part of a line of text."""
    number = getattr(error, "errno", None)
    text = os.strerror(number).lower() if number else str(error)
    return " ".join(text.split()).rstrip(".") or type(error).__name__


Force = Annotated[float, "N"]
Position = Annotated[float, "m"]
Velocity = Annotated[float, "m/s"]


class Ages(NamedTuple):
    """Time [s] since each channel's sample was taken, in the order of the channels."""

    master_force: float
    master_position: float
    slave_position: float
    contact_force: float
    slave_velocity: float


class Measurement(NamedTuple):
    """All channels at one tick, in SI units.

    `CHANNELS` and `UNITS` follow from its fields.

    Positions are displacements from the datum, positive into the environment; forces are
    positive in compression. A channel that the rig does not have is NaN.
    """

    time: float
    """When the rig was read [s], on the clock of the controller."""
    master_force: Force
    """Force of the operator's hand on the handle."""
    master_position: Position
    """Position of the handle."""
    slave_position: Position
    """Position of the slave."""
    contact_force: Force
    """Force between slave and environment."""
    slave_velocity: Velocity
    """Velocity of the slave, where the drive reports it."""
    age: Ages
    drive_error: str = ""
    """The error that a drive reports of itself; empty for none."""
    emergency_stop: bool = False
    """Whether the emergency-stop input that is wired to the rig is open."""

    @property
    def channels(self) -> tuple[float, ...]:
        """The values of the channels, in the order of `CHANNELS`."""
        return self[1:6]


UNITS = {
    name: kind.__metadata__[0]
    for name, kind in get_type_hints(Measurement, include_extras=True).items()
    if get_origin(kind) is Annotated
}
"""SI unit of each measured channel."""
CHANNELS = tuple(UNITS)
"""Names of the measured channels, in their order."""


class Command(NamedTuple):
    """Velocities [m/s] for the two drives; a rig with a passive handle ignores the first."""

    master_velocity: float
    slave_velocity: float


AXES = tuple(name.removesuffix("_velocity") for name in Command._fields)
"""Names of the drives, in the order of a `Command`."""
STANDSTILL = Command(0.0, 0.0)


class Rig(ABC):
    """A telemanipulator, real or simulated.

    Used as a context manager: it is opened on entry, and its drives are idled and it is closed
    on every exit from the block, whatever the reason. A process that is killed does not get
    there: for that the drives have watchdogs of their own, armed by `enable`.
    """

    @property
    def rejected(self) -> Mapping[str, Mapping[str, int]]:
        """How many frames each device did not take, by reason; devices without any are left out."""
        return {}

    @abstractmethod
    def open(self) -> None:
        """Connect to the devices; nothing moves yet."""

    @abstractmethod
    def read(self) -> Measurement:
        """The latest sample of every channel, without waiting for a new one.

        Raises
        ------
        RigError
            A device cannot be read.
        """

    @abstractmethod
    def enable(self) -> bool:
        """Ask the drives to take commands, at standstill, and arm their watchdogs.

        Called once a tick until it says that all drives do.

        Raises
        ------
        RigError
            A drive refuses.
        """

    def rearm(self) -> None:  # noqa: B027
        """Forget the errors that drives are remembered by: a person has seen to them.

        What is still wrong shows again.
        """

    @abstractmethod
    def write(self, command: Command) -> Command:
        """Command the drives, and return what was applied: the command within their limits.

        Raises
        ------
        ValueError
            A velocity is not finite; nothing was commanded.
        RigError
            A drive cannot be commanded.
        """

    @abstractmethod
    def idle(self) -> None:
        """Take the drives out of operation at once, whatever they were doing; may be repeated."""

    @abstractmethod
    def close(self) -> None:
        """Release the devices; also those of an `open` that failed half-way."""

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
