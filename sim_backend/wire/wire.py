"""Base class of wires. A wire connects the emulated devices of one bus to a host."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sim_backend.wire.emulated_device import EmulatedDevice
from sim_backend.wire.wire_faults import WireFault


class Wire(ABC):
    """Connection between the emulated devices of one CAN bus or serial line and the host.

    Attributes
    ----------
    fault
        Fault that changes the data on the way to the host; None if there is no fault.
    """

    fault: WireFault | None = None

    @abstractmethod
    def open(self) -> None:
        """Make the port or bus available to hosts."""

    @abstractmethod
    def serve(self, now: float) -> None:
        """Pass the data of the host to the devices, and the data of the devices to the host.

        `now` is the present time [s]. Data that the host must receive later are stored.
        """

    @abstractmethod
    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Replace the device `old` by `new`, if `old` is on this wire."""

    @abstractmethod
    def close(self) -> None:
        """Remove the port or bus. For a host that has opened the port, the connection is lost."""

    @abstractmethod
    def filenos(self) -> list[int]:
        """Return the file descriptors that become readable when the host sends data."""

    @abstractmethod
    def due(self) -> float:
        """Return the time [s] at which `serve` must next be called.

        This is the time of the next unrequested frame, or the time at which the transmission of a
        frame to the host ends.
        """
