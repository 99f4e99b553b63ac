"""Base class of wires. A wire connects emulated devices to the program that uses them (host)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from sim_backend.wire.emulated_device import EmulatedDevice
from sim_backend.wire.wire_faults import WireFault


class Wire(ABC):
    """CAN bus, serial line or network that connects emulated devices to the host.

    An emulated device is software with the protocol of a real device. The host is the program that
    uses the devices.

    Attributes
    ----------
    to_host, to_devices
        Faults that change the data on the way to the host and to the devices; None if there is no
        fault.
    """

    to_host: WireFault | None = None
    to_devices: WireFault | None = None

    def distort(self, make_fault: Callable[[], WireFault]) -> None:
        """Apply a fault to both directions from now on. It replaces the faults before."""
        self.to_host, self.to_devices = make_fault(), make_fault()

    @abstractmethod
    def open(self) -> None:
        """Create the port, or connect to the CAN bus, so that a host can use the devices."""

    @abstractmethod
    def serve(self, now: float) -> None:
        """Pass the data of the host to the devices, and the data of the devices to the host.

        Data that reach the host only later, for example because their transmission takes time, are
        stored. A later call passes them to the host.
        """

    @abstractmethod
    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Replace the device `old` by `new`. Do nothing if `old` is not on this wire."""

    @abstractmethod
    def close(self) -> None:
        """Remove the port, or disconnect from the CAN bus. The host loses the connection."""

    @abstractmethod
    def filenos(self) -> list[int]:
        """Return the file descriptors that become readable when the host sends data, if any."""

    @abstractmethod
    def due(self) -> float:
        """Return the time [s] at which `serve` must next be called, even if the host sends no data.

        At this time, a device sends a frame that the host has not requested, or the transmission of
        a frame to the host ends. The time is infinite if neither of them is expected.
        """

    def device_entries(self) -> dict[str, dict[str, int]]:
        """Return the entries of devices that a host needs, by the name of the device."""
        return {}

    @abstractmethod
    def host_entries(self) -> dict[str, str | int]:
        """Return the entries of the bus in the rig file with which a host finds the devices."""
