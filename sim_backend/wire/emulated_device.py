"""Base classes of emulated devices, which connect the simulated telemanipulator to a wire."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import can


class Mount(ABC):
    """Interface of an emulated device to the simulated telemanipulator.

    Attributes
    ----------
    rate
        Sample rate [Hz] of devices that send samples without a request from the host.
    """

    rate: float = 1000.0

    @abstractmethod
    def sense(self, signal: str) -> float:
        """Return the present value of a signal of the device, in the unit of the signal.

        If the rig file does not use the signal, the value is the true position, velocity or motor
        force of the device's first drive. The value is 0 for other signals, and for a device
        without a drive.
        """

    @abstractmethod
    def drive(self, name: str, velocity: float) -> None:
        """Move a drive of the device at a velocity [m/s], with the sign that the drive uses."""

    @abstractmethod
    def brake(self, name: str) -> None:
        """Disable a drive of the device, and hold its position."""


class EmulatedDevice(ABC):  # noqa: B024
    """Base class of emulated devices: software with the protocol of a real device.

    An emulated device uses the settings of its driver, but shares no other code with the driver. A
    test with both can therefore find errors of the driver and errors of the emulated device. The
    emulated device has the same watchdogs as the real device. It checks them only when one of its
    methods is called. The methods must therefore be called often, with the present time.

    Parameters
    ----------
    name
        Name of the device in the rig file.
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
        """Return the time [s] at which `emit` next returns a frame that the host did not request.

        The time is infinite if there is no such frame.
        """
        return math.inf


class EmulatedSerialDevice(EmulatedDevice):
    """Base class of emulated devices on a serial port."""

    @abstractmethod
    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host at time `now` [s]. They may be parts of frames."""

    @abstractmethod
    def emit(self, now: float) -> list[bytes]:
        """Return the frames to be sent at time `now` [s]: answers and unrequested frames."""


class EmulatedCanDevice(EmulatedDevice):
    """Base class of emulated devices on a CAN bus. A device receives all frames of the bus."""

    @abstractmethod
    def receive(self, frame: can.Message, now: float) -> None:
        """Process a CAN frame from the bus at time `now` [s]."""

    @abstractmethod
    def emit(self, now: float) -> list[can.Message]:
        """Return the CAN frames to be sent at time `now` [s]."""
