"""Base classes of devices on serial ports and CAN buses."""

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
    """A value, in the unit of its signal, and its sampling time [s] on the controller's clock."""

    value: float
    time: float


NO_SAMPLE = Sample(math.nan, -math.inf)


class DeviceSettings(BaseModel):
    """Base class of the `[devices.NAME]` sections of a rig file. Names of settings have units."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: str


class VelocityDrive(ABC):
    """A drive with velocity control. No method waits.

    Velocities are in m/s, in the positive direction of the drive.
    """

    @abstractmethod
    def enable(self) -> bool:
        """Request operation at standstill; return whether the drive is in operation.

        It is called once per tick until it returns True. It also arms the drive's watchdog.
        """

    @abstractmethod
    def command(self, velocity: float) -> float:
        """Set the velocity that the next `transmit` sends; return it as rounded or limited."""

    @abstractmethod
    def idle(self) -> None:
        """Take the drive out of operation immediately; may be called repeatedly.

        Unlike `command`, it sends its messages itself.
        """


class Device(ABC):
    """A device of a rig, with the signals that it measures and the drives that it controls.

    Parameters
    ----------
    name
        Name of the device in the rig file.
    settings
        Section of the device in the rig file, an instance of `Settings`.

    Attributes
    ----------
    samples
        Latest sample of each signal; `NO_SAMPLE` before the first.
    error
        Error that the device reports; empty for none.
    emergency_stop
        Whether an emergency-stop input of the device is open.
    rejected
        Number of rejected frames, by reason, for example `checksum` or `length`.
    drives
        Drives of the device, by name.
    """

    Settings: ClassVar[type[DeviceSettings]]
    """Class of the device's section in a rig file."""
    estimated: ClassVar[bool] = False
    """Whether the signals are estimated from other signals instead of measured."""

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
        """Return the SI unit of each signal, by name of the signal.

        A sensor with an unknown scale gives the unit of its raw signal, for example `V`. The rig
        file then has a scale for the channel.
        """

    def update(self, now: float) -> None:  # noqa: B027
        """Do the periodic work of a tick, after all buses were read. Default: nothing."""

    def rearm(self) -> None:
        """Clear a latched error. An error that is still present is reported again."""
        self.error = ""

    def transmit(self) -> None:  # noqa: B027
        """Send the commands of the tick. Default: nothing."""

    def ping(self) -> bool:
        """Send a request for a measurement of the round-trip time; return False if unsupported."""
        return False

    def answered(self) -> bool:
        """Return whether the device has answered the last `ping`."""
        return False

    def stop(self) -> None:  # noqa: B027
        """End the session before the bus is closed, with all drives idle. Default: nothing."""


class SerialDevice(Device):
    """A device that is the only one on its serial port."""

    @abstractmethod
    def start(self, port: SerialPort) -> None:
        """Set up the device on an open port; may wait with `port.wait_for`.

        Raises
        ------
        RigError
            The device does not answer, or differs from the rig file.
        """

    @abstractmethod
    def receive(self, data: bytes, now: float) -> None:
        """Process the bytes since the last call; malformed frames are counted in `rejected`.

        Parameters
        ----------
        data
            The bytes. They may start and end within a frame.
        now
            Time of arrival [s].
        """


class CanDevice(Device):
    """A device on a CAN bus, with its own identifiers."""

    @abstractmethod
    def identifiers(self) -> Iterable[int]:
        """Return the identifiers of the frames that it sends; bit 31 marks a 29-bit identifier."""

    @abstractmethod
    def start(self, bus: CanBus) -> None:
        """Set up the device on an open bus; may wait with `bus.wait_for`.

        Raises
        ------
        RigError
            The device does not answer, or differs from the rig file.
        """

    @abstractmethod
    def receive(self, frame: can.Message, time: float) -> None:
        """Process a frame with one of the identifiers; malformed ones are counted in `rejected`.

        Parameters
        ----------
        frame
            The frame.
        time
            Time of arrival [s].
        """


class DerivedDevice(Device):
    """A device in software, whose signals are computed from the signals of other devices."""

    @abstractmethod
    def start(self, devices: Mapping[str, Device]) -> None:
        """Look up the devices that it needs.

        Raises
        ------
        RigError
            A device is missing.
        """


def sole_drive(device: Device, wanted: str) -> str:
    """Return the name of the wanted drive, or of the only one if none is wanted; empty for none."""
    names: Sequence[str] = list(device.drives)
    if wanted:
        return wanted if wanted in names else ""
    return names[0] if len(names) == 1 else ""
