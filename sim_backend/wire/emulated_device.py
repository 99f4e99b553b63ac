"""What an emulated device is: the plant on one side of it, a wire on the other."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import can


class Mount(ABC):
    """Where a device is mounted on the emulated telemanipulator.

    Attributes
    ----------
    rate
        At which devices that stream by themselves have been set up to do so [Hz].
    """

    rate: float = 1000.0

    @abstractmethod
    def sense(self, signal: str) -> float:
        """What the device's signal reads now [SI unit, or the sensor's own]; 0 if not in use."""

    @abstractmethod
    def drive(self, name: str, velocity: float) -> None:
        """Let a drive of the device go at a velocity [m/s], in its own direction."""

    @abstractmethod
    def brake(self, name: str) -> None:
        """Hold that drive: it is idle."""


class EmulatedDevice(ABC):  # noqa: B024
    """A device in software, true to the wire.

    It has the same settings as its driver and shares no other code with it, so that each tests
    the other. Its watchdogs are its own: it is called often, with the present time.

    Parameters
    ----------
    name
        What the rig file calls it.
    settings
        The device's section of the rig file.
    mount
        What it is mounted on.
    """

    def __init__(self, name: str, settings: Any, mount: Mount) -> None:
        self.name = name
        self.settings = settings
        self.mount = mount

    def due(self) -> float:
        """When `emit` has something by itself [s]; infinite where it is asked for it."""
        return math.inf


class EmulatedSerialDevice(EmulatedDevice):
    """A device behind a serial port of its own."""

    @abstractmethod
    def receive(self, data: bytes, now: float) -> None:
        """Take in bytes from the host, cut anywhere."""

    @abstractmethod
    def emit(self, now: float) -> list[bytes]:
        """The frames that are due by now [s]: answers, and what is sent by itself."""


class EmulatedCanDevice(EmulatedDevice):
    """A device on a CAN bus; it sees every frame."""

    @abstractmethod
    def receive(self, frame: can.Message, now: float) -> None:
        """Take in a frame from the bus."""

    @abstractmethod
    def emit(self, now: float) -> list[can.Message]:
        """The frames that are due by now [s]."""
