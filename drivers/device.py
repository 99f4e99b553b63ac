"""Base classes of the devices and drives of a rig (the hardware of a telemanipulator)."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from pydantic import BaseModel, ConfigDict

if TYPE_CHECKING:
    from drivers.transports.can_bus import CanBus
    from drivers.transports.can_frame import CanFrame
    from drivers.transports.datagram_port import DatagramPort
    from drivers.transports.shared_line import SharedLine
    from drivers.transports.stream_port import StreamPort


class Sample(NamedTuple):
    """One sample of a signal.

    The value is in the unit of the signal. The time is the time at which the sample was taken [s],
    on the controller's clock.
    """

    value: float
    time: float


NO_SAMPLE = Sample(math.nan, -math.inf)
"""Sample of a signal before its first value is received."""


class DeviceSettings(BaseModel):
    """Base class of the settings of a device: the section `[devices.NAME]` of the rig file.

    The rig file describes the hardware. If a setting has a unit, the name of the setting ends with
    this unit, for example `watchdog_ms`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: str


class Drive(ABC):
    """Base class of drives. `VelocityDrive`, `ForceDrive` and the others state what they accept.

    Positions are in m, velocities in m/s, forces in N. They are positive in the positive direction
    of the drive. The methods send messages to the device, but do not wait for its answer.
    """

    signal = ""
    """Name of the signal of the device that measures the position of the drive; empty if the rig
    does not need it."""
    reports_watchdog = True
    """Whether the device reports in `Device.error` that its watchdog has stopped the drive."""

    @abstractmethod
    def enable(self) -> bool:
        """Request that the drive goes into operation, without motion and without force.

        In operation, the drive follows commands, and its watchdog is active. This method is called
        once per tick until it returns True.

        Returns
        -------
        bool
            Whether the drive is in operation.
        """

    @abstractmethod
    def idle(self) -> bool:
        """Request that the drive leaves operation; return whether the drive has confirmed it.

        This method sends its messages at once. It does not wait for the next `Device.transmit`.
        It is called once per tick until it returns True, because messages can be lost. It may also
        be called later, and before the drive was in operation.

        Until the drive has confirmed, the device sends no other message that resets the watchdog
        timer of the drive. If every request is lost, the watchdog thus stops the drive. A request
        that itself resets this timer is repeated with pauses that become longer than the watchdog
        time.

        Returns
        -------
        bool
            Whether the drive has reported, after the request, that it is out of operation.
        """


class VelocityDrive(Drive):
    """A drive with velocity control."""

    @abstractmethod
    def command(self, velocity: float) -> float:
        """Store the velocity that the next call of `Device.transmit` sends to the drive.

        Parameters
        ----------
        velocity
            Wanted velocity [m/s].

        Returns
        -------
        float
            Velocity that will be sent [m/s]. The device may round and limit the wanted velocity.
        """


class PositionDrive(Drive):
    """A drive with position control."""

    signal = "position"

    @abstractmethod
    def command(self, position: float) -> float:
        """Store the position that the next call of `Device.transmit` sends to the drive.

        Parameters
        ----------
        position
            Wanted position [m], on the scale of the position signal of the drive.

        Returns
        -------
        float
            Position that will be sent [m]. The device may round and limit the wanted position.
        """


class ForceDrive(Drive):
    """A drive that exerts a commanded force, for example a motor with torque control."""

    @abstractmethod
    def command(self, force: float) -> float:
        """Store the force that the next call of `Device.transmit` sends to the drive.

        Parameters
        ----------
        force
            Wanted force of the drive on the moving part [N].

        Returns
        -------
        float
            Force that will be sent [N]. The device may round and limit the wanted force.
        """


class ImpedanceDrive(Drive):
    """A drive that itself computes the force of a spring and a damper from its own encoder.

    Motors with the "MIT mode" are such drives. Their loop has no delay of a bus.
    """

    signal = "position"
    rate = 1000.0
    """Rate with which the drive computes the force [Hz], if the rig file does not state it. The
    manuals of such motors do not state it, so that this rate is an assumption."""

    def rounded(self, stiffness: float, damping: float) -> tuple[float, float]:
        """Return the gains that the drive applies in place of the wanted ones.

        The default method returns them unchanged.

        Parameters
        ----------
        stiffness
            Wanted stiffness [N/m].
        damping
            Wanted damping [N s/m].

        Returns
        -------
        tuple
            Nearest stiffness [N/m] and damping [N s/m] that the drive can apply.
        """
        return stiffness, damping

    @abstractmethod
    def command(
        self, position: float, velocity: float, stiffness: float, damping: float
    ) -> tuple[float, float]:
        """Store the reference and the gains that the next `Device.transmit` sends to the drive.

        The force of the drive on the moving part is stiffness * (position - x) + damping *
        (velocity - v), where x and v are the motion that the encoder of the drive measures.

        Parameters
        ----------
        position
            Reference position [m], on the scale of the position signal of the drive.
        velocity
            Reference velocity [m/s].
        stiffness
            Stiffness of the spring [N/m].
        damping
            Damping of the damper [N s/m].

        Returns
        -------
        tuple
            Position [m] and velocity [m/s] that will be sent. The device may round and limit them.
        """


class OnlyDrive(Drive):
    """The only drive of a device. The methods `enable` and `idle` of the device operate it."""

    def __init__(self, device: Any) -> None:
        self._device = device

    def enable(self) -> bool:
        """Request operation; return whether the drive is in operation."""
        enabled: bool = self._device.enable()
        return enabled

    def idle(self) -> bool:
        """Request that the drive leaves operation; return whether it has confirmed it."""
        stopped: bool = self._device.idle()
        return stopped


class Device(ABC):
    """Base class of the devices of a rig. A device measures signals and controls drives.

    Parameters
    ----------
    name
        Name of the device in the rig file.
    settings
        Section of the device in the rig file, an instance of the class `Settings` of the device.

    Attributes
    ----------
    samples
        Latest sample of each signal, by the name of the signal; `NO_SAMPLE` until the first sample
        is received.
    error
        Error that the device reports, as text; empty if there is no error.
    emergency_stop
        Whether an emergency-stop input of the device is open.
    rejected
        Number of rejected messages of the device, by reason, for example `checksum` or `length`.
    drives
        Drives that the device controls, by name.
    """

    Settings: ClassVar[type[DeviceSettings]]
    """Class of the settings in the section of the device in a rig file."""
    estimated: ClassVar[bool] = False
    """Whether the signals are estimated from signals of other devices, and not measured."""
    silent_without_commands: ClassVar[bool] = False
    """Whether the device in operation sends samples only as long as it gets commands."""

    def __init__(self, name: str, settings: Any) -> None:
        self.name = name
        self.settings = settings
        self.samples = dict.fromkeys(self.signals(), NO_SAMPLE)
        self.error = ""
        self.emergency_stop = False
        self.rejected: Counter[str] = Counter()
        self.drives: dict[str, Drive] = {}

    @abstractmethod
    def signals(self) -> Mapping[str, str]:
        """Return the SI unit of each signal, by the name of the signal.

        If the scale of a sensor is unknown, the signal has the unit of the raw value, for example
        `V`. The rig file must then give a scale for each channel that is computed from the signal.
        """

    def update(self, now: float) -> None:  # noqa: B027
        """Do the periodic work of the device, for example detect that messages are missing.

        This method is called at each tick, after all received messages were processed. The default
        method does nothing.

        Parameters
        ----------
        now
            Time of the tick on the controller's clock [s].
        """

    def rearm(self) -> None:
        """Clear the stored error. If its cause is still present, the error is reported again."""
        self.error = ""

    def transmit(self) -> None:  # noqa: B027
        """Send the commands that the method `command` of the drives has stored.

        The default method does nothing.
        """

    def ping(self) -> bool:
        """Send a request, so that the round-trip time to the device can be measured.

        Returns
        -------
        bool
            Whether a request was sent. It is False if the device has no suitable request, or if
            no request can be sent at present.
        """
        return False

    def answered(self) -> bool:
        """Return whether the answer to the last `ping` has been received."""
        return False

    def about(self) -> Mapping[str, str]:
        """Return what the device has stated about itself, such as its version, by name.

        It is part of a report (`teleop rig report`). This method is called once, after the device
        was set up and while its drives are out of operation. It may wait. The default method
        returns nothing.

        Raises
        ------
        RigError
            The device does not answer.
        """
        return {}

    def stop(self) -> None:  # noqa: B027
        """End the communication with the device, before its port or bus is closed.

        When this method is called, the drives are already out of operation. The default method
        does nothing.
        """


class SerialDevice(Device):
    """A device on a serial port or a TCP connection. No other device uses this port."""

    @abstractmethod
    def start(self, port: StreamPort) -> None:
        """Set up the device on an open port. This method may wait with `port.wait_for`.

        Raises
        ------
        RigError
            The device does not answer, or does not match its settings in the rig file.
        """

    @abstractmethod
    def receive(self, data: bytes, now: float) -> None:
        """Process the bytes received since the last call.

        Malformed messages are counted in `rejected`.

        Parameters
        ----------
        data
            The bytes. The first and the last message may be incomplete.
        now
            Time of arrival on the controller's clock [s].
        """


class LineRequest(NamedTuple):
    """A request to a device on a shared serial line."""

    data: bytes
    """Bytes of the request."""
    seconds: float
    """Longest time from the end of the request until its whole answer has arrived [s]. Without an
    answer, the time for which the line must be quiet after the request."""
    is_answered: bool = True
    """Whether the device answers."""


class LineFrames(NamedTuple):
    """Frames that were found in the bytes of a shared serial line."""

    frames: Sequence[tuple[int, bytes]]
    """Address of the device and whole frame, in the order of arrival."""
    rejected: Mapping[str, int]
    """Number of malformed frames, by reason."""
    rest: bytes
    """Bytes at the end, which can be the beginning of a frame."""


class SharedSerialDevice(Device):
    """A device on a serial line that it may share with other devices of the same kind.

    The device sends a frame only as the answer to a request, and this frame contains the address of
    the device. Only one request is on the line at a time. The devices take turns.
    """

    @property
    @abstractmethod
    def address(self) -> int:
        """Address of the device in its frames."""

    @classmethod
    @abstractmethod
    def split(cls, data: bytes) -> LineFrames:
        """Find the frames of all devices in the received bytes.

        Parameters
        ----------
        data
            The rest of the last call, and the bytes that have arrived since.
        """

    @abstractmethod
    def start(self, line: SharedLine) -> None:
        """Set up the device on an open line. This method may wait with `line.wait_for`.

        From now on, `request` is called.

        Raises
        ------
        RigError
            The device does not answer, or does not match its settings in the rig file.
        """

    @abstractmethod
    def request(self, now: float) -> LineRequest | None:
        """Return the request that is sent now; None to leave the turn to the next device.

        A drive returns a request to leave operation, until it has confirmed it, before any other
        request.

        Parameters
        ----------
        now
            Time on the controller's clock [s].
        """

    @abstractmethod
    def receive(self, frame: bytes, time: float) -> None:
        """Process a frame of the device. Malformed frames are counted in `rejected`.

        Parameters
        ----------
        frame
            A whole frame, as returned by `split`.
        time
            Time of arrival on the controller's clock [s].
        """


class CanDevice(Device):
    """A device on a CAN bus.

    The device sends frames with certain identifiers. No other device on the bus sends frames with
    these identifiers.
    """

    needs_fd: ClassVar[bool] = False
    """Whether the device needs a bus with CAN FD."""

    @abstractmethod
    def identifiers(self) -> Iterable[int]:
        """Return the identifiers of the CAN frames that the device sends.

        If an identifier has 29 bits (extended frame), bit 31 of the returned number is set.
        """

    @abstractmethod
    def start(self, bus: CanBus) -> None:
        """Set up the device on an open bus. This method may wait with `bus.wait_for`.

        Raises
        ------
        RigError
            The device does not answer, or does not match its settings in the rig file.
        """

    @abstractmethod
    def receive(self, frame: CanFrame, time: float) -> None:
        """Process a CAN frame that the device has sent.

        Malformed frames are counted in `rejected`.

        Parameters
        ----------
        frame
            The frame. Its identifier is one of those that `identifiers` returns.
        time
            Time of arrival on the controller's clock [s].
        """


class DatagramDevice(Device):
    """A device that exchanges UDP datagrams. No other device uses its address."""

    @abstractmethod
    def start(self, port: DatagramPort) -> None:
        """Set up the device on an open port. This method may wait with `port.wait_for`.

        Raises
        ------
        RigError
            The device does not answer, or does not match its settings in the rig file.
        """

    @abstractmethod
    def receive(self, data: bytes, time: float) -> None:
        """Process a datagram that the device has sent.

        Datagrams can be lost, repeated, or received in another order. Use the newest datagram, and
        count in `rejected` those that are older than a received one. Malformed datagrams are also
        counted there.

        Parameters
        ----------
        data
            The datagram.
        time
            Time of arrival on the controller's clock [s].
        """


class DerivedDevice(Device):
    """A device without hardware. Its signals are computed from the signals of other devices."""

    @abstractmethod
    def start(self, devices: Mapping[str, Device]) -> None:
        """Find the devices from whose signals this device computes its own signals.

        Parameters
        ----------
        devices
            All devices of the rig, by name.

        Raises
        ------
        RigError
            There is no device with the needed signals.
        """


class LibraryDevice(Device):
    """A device that a library of its vendor accesses, and which has no bus in the rig file.

    The method `update` reads the device, and `transmit` commands it.
    """

    @abstractmethod
    def start(self, now: Callable[[], float]) -> None:
        """Open the device. This method may wait. `stop` closes the device.

        Parameters
        ----------
        now
            Returns the time on the controller's clock [s].

        Raises
        ------
        RigError
            The device cannot be opened, or does not match its settings in the rig file.
        """


def sole_drive(device: Device, wanted: str) -> str:
    """Return the name of the wanted drive of a device, or of its only drive.

    Parameters
    ----------
    device
        The device.
    wanted
        Name of the wanted drive. If it is empty, the only drive of the device is wanted.

    Returns
    -------
    str
        Name of the drive. The name is empty if the device has no drive with the name `wanted`, or
        if `wanted` is empty and the device does not have exactly one drive.
    """
    names: Sequence[str] = list(device.drives)
    if wanted:
        return wanted if wanted in names else ""
    return names[0] if len(names) == 1 else ""
