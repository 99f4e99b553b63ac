"""A CAN bus between emulated devices and a host: over an slcan adapter, or any interface."""

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
"""Most CAN frames that are read at once."""
BUS_OFF = 0x40
"""Linux's flag of an error frame that tells that a controller has left the bus."""
ERROR_WARNING, BUS_ERROR = 0x04, 0x80
"""An slcan adapter's flags; it hands on no error frames."""


class CanWire(Wire):
    """Devices that share a CAN bus, and what takes frames to the host."""

    def __init__(self, devices: Sequence[EmulatedCanDevice]) -> None:
        self.devices = list(devices)

    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Put the new device on the bus."""
        if old in self.devices:
            assert isinstance(new, EmulatedCanDevice)
            self.devices = [new if device is old else device for device in self.devices]

    @abstractmethod
    def from_host(self) -> list[can.Message]:
        """The frames that the host has sent."""

    @abstractmethod
    def to_host(self, frames: list[can.Message]) -> None:
        """Send frames to the host."""

    def due(self) -> float:
        """When the first of the devices sends next [s]."""
        return min((device.due() for device in self.devices), default=math.inf)

    def serve(self, now: float) -> None:
        """Hand the devices the host's frames and each other's, and the host theirs."""
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
    """A CAN bus behind an slcan adapter on a pseudo-terminal."""

    def __init__(self, path: Path, devices: Sequence[EmulatedCanDevice]) -> None:
        super().__init__(devices)
        self.port = PseudoTerminal(path)
        self.adapter = SlcanAdapter()

    def open(self) -> None:
        """Plug the adapter in."""
        self.port.open()

    def from_host(self) -> list[can.Message]:
        """The frames that the adapter is told to send."""
        return self.adapter.receive(self.port.read())

    def to_host(self, frames: list[can.Message]) -> None:
        """The adapter's answers, then what it hears on the bus."""
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
        """Unplug the adapter; it forgets its settings."""
        self.port.close()
        self.adapter = SlcanAdapter()

    def filenos(self) -> list[int]:
        """The pseudo-terminal."""
        return self.port.filenos()


class InterfaceWire(CanWire):
    """A CAN bus behind any interface of python-can, such as SocketCAN."""

    def __init__(self, interface: str, channel: str, devices: Sequence[EmulatedCanDevice]) -> None:
        super().__init__(devices)
        self._interface, self._channel = interface, channel
        self._bus: can.BusABC | None = None

    def open(self) -> None:
        """Join the bus; OSError if there is none."""
        try:
            self._bus = can.Bus(interface=self._interface, channel=self._channel)
        except can.CanError as error:
            raise OSError(str(error)) from error

    def from_host(self) -> list[can.Message]:
        """The frames of everybody else on the bus."""
        frames: list[can.Message] = []
        while self._bus and len(frames) < MOST and (frame := self._bus.recv(0)):
            frames.append(frame)
        return frames

    def to_host(self, frames: list[can.Message]) -> None:
        """Put frames on the bus; those that it does not take are lost."""
        assert self._bus
        for frame in frames:
            with contextlib.suppress(can.CanError, OSError):
                self._bus.send(frame)

    def close(self) -> None:
        """Leave the bus."""
        if self._bus:
            self._bus.shutdown()
        self._bus = None

    def filenos(self) -> list[int]:
        """The bus, where its interface is a file."""
        number = self._bus.fileno() if self._bus else -1
        return [number] if number >= 0 else []
