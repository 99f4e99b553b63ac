"""CAN buses that connect emulated devices to a host. The host uses slcan or another interface."""

from __future__ import annotations

import contextlib
import math
from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path

import can

from sim_backend.wire.emulated_device import EmulatedCanDevice, EmulatedDevice
from sim_backend.wire.pseudo_terminal import PseudoTerminal
from sim_backend.wire.slcan_adapter import SlcanAdapter
from sim_backend.wire.wire import Wire

MOST = 1000
"""Largest number of CAN frames that one call of `from_host` returns."""
BUS_OFF = 0x40
"""Bit in the identifier of an error frame of Linux: the controller is bus-off."""
ERROR_WARNING, BUS_ERROR = 0x04, 0x80
"""Status flags of an slcan adapter. The adapter sets flags instead of sending error frames."""


class CanWire(Wire):
    """Base class of CAN buses with emulated devices."""

    def __init__(self, devices: Sequence[EmulatedCanDevice]) -> None:
        self.devices = list(devices)

    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Replace the old device on the bus by the new device."""
        if old in self.devices:
            assert isinstance(new, EmulatedCanDevice)
            self.devices = [new if device is old else device for device in self.devices]

    @abstractmethod
    def from_host(self) -> list[can.Message]:
        """Return the CAN frames that the host has sent since the last call."""

    @abstractmethod
    def to_host(self, frames: list[can.Message]) -> None:
        """Send CAN frames to the host."""

    def due(self) -> float:
        """Return the earliest time at which a device sends its next frame [s]."""
        return min((device.due() for device in self.devices), default=math.inf)

    def serve(self, now: float) -> None:
        """Pass CAN frames of the host to all devices, and frames of a device to all other devices.

        The host receives the frames of all devices, changed by the fault if there is one.
        """
        for frame in self.from_host():
            for device in self.devices:
                device.receive(frame, now)
        frames: list[can.Message] = []
        for device in self.devices:
            own = device.emit(now)
            frames += own
            for other in self.devices:
                if other is not device:
                    for frame in own:
                        other.receive(frame, now)
        if self.fault:
            frames = [self.fault.frame(f) for f in self.fault.frames(frames, now)]
        self.to_host(frames)


class SlcanWire(CanWire):
    """A CAN bus to which the host is connected by an slcan adapter on a pseudo-terminal."""

    def __init__(self, path: Path, devices: Sequence[EmulatedCanDevice]) -> None:
        super().__init__(devices)
        self.port = PseudoTerminal(path)
        self.adapter = SlcanAdapter()

    def open(self) -> None:
        """Create the port of the adapter."""
        self.port.open()

    def from_host(self) -> list[can.Message]:
        """Return the frames that the host has sent to the adapter."""
        return self.adapter.receive(self.port.read())

    def to_host(self, frames: list[can.Message]) -> None:
        """Send the answers of the adapter, followed by the CAN frames from the bus.

        Error frames are not sent. Instead, an error frame sets a status flag of the adapter. While
        the status flag for a bus error is set, no CAN frames are sent.
        """
        for error in [frame for frame in frames if frame.is_error_frame]:
            self.adapter.flags |= BUS_ERROR if error.arbitration_id & BUS_OFF else ERROR_WARNING
        if self.adapter.flags & BUS_ERROR:
            frames = []
        heard = [frame for frame in frames if not frame.is_error_frame]
        data = self.adapter.pending() + b"".join(map(self.adapter.encode, heard))
        if self.fault:
            data = self.fault.octets(data) + self.fault.noise()
        self.port.write(data)

    def close(self) -> None:
        """Remove the port of the adapter. The adapter loses its settings."""
        self.port.close()
        self.adapter = SlcanAdapter()

    def filenos(self) -> list[int]:
        """Return the file descriptor of the pseudo-terminal."""
        return self.port.filenos()


class InterfaceWire(CanWire):
    """A CAN bus to which emulator and host connect by python-can, for example with SocketCAN."""

    def __init__(self, interface: str, channel: str, devices: Sequence[EmulatedCanDevice]) -> None:
        super().__init__(devices)
        self._interface, self._channel = interface, channel
        self._bus: can.BusABC | None = None

    def open(self) -> None:
        """Connect to the bus; raise OSError if it does not exist."""
        try:
            self._bus = can.Bus(interface=self._interface, channel=self._channel)
        except can.CanError as error:
            raise OSError(str(error)) from error

    def from_host(self) -> list[can.Message]:
        """Return the CAN frames that other nodes on the bus have sent since the last call."""
        frames: list[can.Message] = []
        while self._bus and len(frames) < MOST and (frame := self._bus.recv(0)):
            frames.append(frame)
        return frames

    def to_host(self, frames: list[can.Message]) -> None:
        """Send CAN frames to the bus. Frames that the bus does not accept are lost."""
        assert self._bus
        for frame in frames:
            with contextlib.suppress(can.CanError, OSError):
                self._bus.send(frame)

    def close(self) -> None:
        """Disconnect from the bus."""
        if self._bus:
            self._bus.shutdown()
        self._bus = None

    def filenos(self) -> list[int]:
        """Return the file descriptor of the bus, if its interface has one."""
        number = self._bus.fileno() if self._bus else -1
        return [number] if number >= 0 else []
