"""Base classes of emulated devices, which connect the simulated plant to a wire."""

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
        Sample rate that is set on devices that send unrequested samples [Hz].
    """

    rate: float = 1000.0

    @abstractmethod
    def sense(self, signal: str) -> float:
        """Return the present value of a signal, in its unit; 0 if the signal is not used."""

    @abstractmethod
    def drive(self, name: str, velocity: float) -> None:
        """Move a drive of the device at a velocity [m/s], in the direction of the drive."""

    @abstractmethod
    def brake(self, name: str) -> None:
        """Hold a drive of the device, which is idle."""


class EmulatedDevice(ABC):  # noqa: B024
    """Base class of devices in software with the protocol of the real device.

    It has the same settings as its driver but shares no other code with it, so that driver and
    emulation test each other. It has its own watchdogs, so it must be called often, with the
    present time.

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
        """Return the time of the next unrequested frame of `emit` [s]; infinite for none."""
        return math.inf


class EmulatedSerialDevice(EmulatedDevice):
    """Base class of devices on a serial port."""

    @abstractmethod
    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host, which may start and end within a frame."""

    @abstractmethod
    def emit(self, now: float) -> list[bytes]:
        """Return the frames that are due at time `now` [s]: answers and unrequested frames."""


class EmulatedCanDevice(EmulatedDevice):
    """Base class of devices on a CAN bus, which receive all frames of the bus."""

    @abstractmethod
    def receive(self, frame: can.Message, now: float) -> None:
        """Process a frame from the bus."""

    @abstractmethod
    def emit(self, now: float) -> list[can.Message]:
        """Return the frames that are due at time `now` [s]."""
