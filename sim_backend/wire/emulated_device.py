"""Base classes of emulated devices.

An emulated device measures or moves the simulated telemanipulator. It communicates with a host (the
control program) by the protocol of a real device.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import can


class Mount(ABC):
    """Interface of an emulated device to the simulated telemanipulator.

    Attributes
    ----------
    rate
        Sample rate [Hz] of devices that send samples periodically, without requests of the host.
    """

    rate: float = 1000.0

    @abstractmethod
    def sense(self, signal: str) -> float:
        """Return the present value of a signal of the device, in the unit of the signal.

        If the rig file assigns the signal to a channel, the signal is computed
        from the simulated value of the channel. If not, the signals `position`, `velocity` and
        `force` are the true position [m], velocity [m/s] and motor force [N] of the first drive of
        the device. For another signal, or if the device has no drive, the value is 0.
        """

    @abstractmethod
    def drive(self, name: str, velocity: float) -> None:
        """Enable a drive of the device if it is disabled, and command its velocity.

        Parameters
        ----------
        name
            Name of the drive in its device.
        velocity
            Velocity [m/s], positive in the positive direction of the drive.
        """

    def push(self, name: str, force: float) -> None:
        """Enable a drive of the device if it is disabled, and command the force of its motor.

        Parameters
        ----------
        name
            Name of the drive in its device.
        force
            Force on the moving part [N], positive in the positive direction of the drive.
        """
        raise NotImplementedError(f"{type(self).__name__} has no drive that accepts forces")

    @abstractmethod
    def brake(self, name: str) -> None:
        """Disable the drive of the device with this name. The drive stops."""


class EmulatedDevice(ABC):  # noqa: B024
    """Base class of emulated devices: software with the protocol of a real device.

    An emulated device and the driver of the real device read the same section of the rig file, but
    share no other code. If one of them interprets the protocol wrongly, a test in which they
    communicate with each other can therefore find the error.

    The emulated device has the same watchdogs as the real device, but checks them only when one of
    its methods is called. The methods must therefore be called often, with the present time.

    Parameters
    ----------
    name
        Name of the device in the rig file (TOML file that describes the telemanipulator).
    settings
        Section of the device in the rig file.
    mount
        Interface to the simulated telemanipulator.
    """

    def __init__(self, name: str, settings: Any, mount: Mount) -> None:
        self.name = name
        self.settings = settings
        self.mount = mount

    def due(self) -> float:
        """Return the time [s] at which the device next sends a frame without a request.

        At this time, the emulator calls `emit`. The emulator also calls `emit` periodically. If
        this is sufficient for the device, or if the device sends no such frame, the time is
        infinite.
        """
        return math.inf


class EmulatedSerialDevice(EmulatedDevice):
    """Base class of emulated devices on a serial port or a TCP connection."""

    @abstractmethod
    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host at time `now` [s]. The last frame may be incomplete."""

    @abstractmethod
    def emit(self, now: float) -> list[bytes]:
        """Return the frames that the device sends at time `now` [s], including answers."""


class EmulatedDatagramDevice(EmulatedDevice):
    """Base class of emulated devices that exchange UDP datagrams.

    Attributes
    ----------
    pages
        Pages of the web server of the device, by path. A device without pages has no web server.
        With a web server, the section of the device in a rig file has the entry `http_port`.
    """

    pages: Mapping[str, bytes] = MappingProxyType({})

    @abstractmethod
    def receive(self, data: bytes, now: float) -> None:
        """Process a datagram from the host at time `now` [s]."""

    @abstractmethod
    def emit(self, now: float) -> list[bytes]:
        """Return the datagrams that the device sends at time `now` [s], including answers."""


class EmulatedCanDevice(EmulatedDevice):
    """Base class of emulated devices on a CAN bus.

    A device receives all CAN frames of the host and of the other devices on the bus.
    """

    @abstractmethod
    def receive(self, frame: can.Message, now: float) -> None:
        """Process a CAN frame from the bus at time `now` [s]."""

    @abstractmethod
    def emit(self, now: float) -> list[can.Message]:
        """Return the CAN frames that the device sends at time `now` [s], including answers."""
