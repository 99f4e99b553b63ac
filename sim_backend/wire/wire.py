"""What lies between the emulated devices of one bus and a host."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sim_backend.wire.emulated_device import EmulatedDevice
from sim_backend.wire.wire_faults import WireFault


class Wire(ABC):
    """What lies between the devices of one bus and the host.

    Attributes
    ----------
    fault
        What befalls everything on its way to the host; None for nothing.
    """

    fault: WireFault | None = None

    @abstractmethod
    def open(self) -> None:
        """Let hosts connect."""

    @abstractmethod
    def serve(self, now: float) -> None:
        """Hand the devices what the host sent, and the host what is due by now [s]."""

    @abstractmethod
    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Put a device in the place of another, if that is on this wire."""

    @abstractmethod
    def close(self) -> None:
        """Take the wire away; a host that is connected finds its port gone."""

    @abstractmethod
    def filenos(self) -> list[int]:
        """What becomes readable when the host sends something."""

    @abstractmethod
    def due(self) -> float:
        """When a device has something to send by itself, or something under way arrives [s]."""
