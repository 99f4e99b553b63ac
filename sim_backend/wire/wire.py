"""Base class of wires between the emulated devices of a bus and a host."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sim_backend.wire.emulated_device import EmulatedDevice
from sim_backend.wire.wire_faults import WireFault


class Wire(ABC):
    """Connection between the devices of one bus and the host.

    Attributes
    ----------
    fault
        Fault that changes the data to the host; None for none.
    """

    fault: WireFault | None = None

    @abstractmethod
    def open(self) -> None:
        """Make the port or bus available to hosts."""

    @abstractmethod
    def serve(self, now: float) -> None:
        """Transfer the data of the host to the devices, and data due at `now` [s] to the host."""

    @abstractmethod
    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Replace a device by another, if it is on this wire."""

    @abstractmethod
    def close(self) -> None:
        """Remove the port or bus; a connected host finds its port disconnected."""

    @abstractmethod
    def filenos(self) -> list[int]:
        """Return the file descriptors that become readable when the host sends data."""

    @abstractmethod
    def due(self) -> float:
        """Return the time of the next unrequested frame, or of the next arrival [s]."""
