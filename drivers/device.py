"""Devices: what stands behind a serial port, or behind some identifiers of a CAN bus."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from pydantic import BaseModel, ConfigDict

if TYPE_CHECKING:
    import can

    from drivers.transports.can_bus import CanBus
    from drivers.transports.serial_port import SerialPort


class Sample(NamedTuple):
    """A value [SI unit of its signal] and when it was sampled [s], on the controller's clock."""

    value: float
    time: float


NO_SAMPLE = Sample(math.nan, -math.inf)


class DeviceSettings(BaseModel):
    """What every `[devices.NAME]` section of a rig file has; units stand in the names."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: str


class VelocityDrive(ABC):
    """A drive that follows a velocity; each call returns at once.

    Velocities are in m/s, in the drive's own direction.
    """

    @abstractmethod
    def enable(self) -> bool:
        """Ask the drive to take commands, at standstill; whether it does by now.

        Called once a tick until it says so. The drive's watchdog is armed with it.
        """

    @abstractmethod
    def command(self, velocity: float) -> float:
        """Set the velocity that the next `transmit` sends; returns what the drive makes of it."""

    @abstractmethod
    def idle(self) -> None:
        """Take the drive out of operation at once, without waiting; may be repeated.

        Unlike `command` it sends what it has to by itself.
        """


class Device(ABC):
    """A device on a rig: signals that it measures, and drives that it moves.

    Parameters
    ----------
    name
        What the rig file calls it.
    settings
        Its section of the rig file, an instance of its `Settings`.

    Attributes
    ----------
    samples
        The latest sample of each signal; `NO_SAMPLE` before the first.
    error
        The error that the device reports of itself; empty for none.
    emergency_stop
        Whether an emergency-stop input that is wired to it is open.
    rejected
        How many frames were not taken, by reason, such as `checksum` or `length`.
    drives
        The drives that it moves, by name.
    """

    Settings: ClassVar[type[DeviceSettings]]
    """The device's section in a rig file."""
    estimated: ClassVar[bool] = False
    """Whether its signals are estimated from others, not measured."""

    def __init__(self, name: str, settings: Any) -> None:
        self.name = name
        self.settings = settings
        self.samples = dict.fromkeys(self.signals(), NO_SAMPLE)
        self.error = ""
        self.emergency_stop = False
        self.rejected: Counter[str] = Counter()
        self.drives: dict[str, VelocityDrive] = {}

    @abstractmethod
    def signals(self) -> Mapping[str, str]:
        """What it measures, by name, each with its SI unit.

        A sensor that does not know it gives its own, such as `V`; the rig file scales it then.
        """

    def update(self, now: float) -> None:  # noqa: B027
        """Do what is due at a tick after all buses were read; by itself nothing."""

    def rearm(self) -> None:
        """Forget the error that is remembered; what is still wrong shows again."""
        self.error = ""

    def transmit(self) -> None:  # noqa: B027
        """Send what the tick has commanded; by itself nothing."""

    def ping(self) -> bool:
        """Ask the device something, for the round trip to be timed; whether it can be asked."""
        return False

    def answered(self) -> bool:
        """Whether the answer to the last `ping` has come."""
        return False

    def stop(self) -> None:  # noqa: B027
        """Say goodbye before the bus closes; the drives are idle already. By itself nothing."""


class SerialDevice(Device):
    """A device that has a serial port to itself."""

    @abstractmethod
    def start(self, port: SerialPort) -> None:
        """Begin on an open port: hand-shake and set up; may wait with `port.wait_for`.

        Raises
        ------
        RigError
            The device does not answer, or is not the one that the rig file says.
        """

    @abstractmethod
    def receive(self, data: bytes, now: float) -> None:
        """Take in what arrived since the last call; malformed bytes are counted, never raised.

        Parameters
        ----------
        data
            The bytes, cut anywhere.
        now
            When they arrived [s].
        """


class CanDevice(Device):
    """A device behind some identifiers of a CAN bus."""

    @abstractmethod
    def identifiers(self) -> Iterable[int]:
        """The identifiers under which it sends; those of 29 bits with bit 31 set besides."""

    @abstractmethod
    def start(self, bus: CanBus) -> None:
        """Begin on an open bus: set up; may wait with `bus.wait_for`.

        Raises
        ------
        RigError
            The device does not answer, or is not the one that the rig file says.
        """

    @abstractmethod
    def receive(self, frame: can.Message, time: float) -> None:
        """Take in a frame with one of the device's identifiers; malformed ones are counted.

        Parameters
        ----------
        frame
            The frame.
        time
            When it arrived [s].
        """


class DerivedDevice(Device):
    """A device in software: what it measures follows from what other devices measure."""

    @abstractmethod
    def start(self, devices: Mapping[str, Device]) -> None:
        """Find the devices that it needs.

        Raises
        ------
        RigError
            One is missing.
        """


def sole_drive(device: Device, wanted: str) -> str:
    """The drive of a device by name, or its only one; empty if there is none."""
    names: Sequence[str] = list(device.drives)
    if wanted:
        return wanted if wanted in names else ""
    return names[0] if len(names) == 1 else ""
