"""CAN buses that connect emulated devices to a host (the computer that controls the devices).

The host uses an slcan adapter (CAN adapter on a serial port) or another interface of python-can.
"""

from __future__ import annotations

import contextlib
import math
from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import can

from sim_backend.wire.emulated_device import EmulatedCanDevice, EmulatedDevice
from sim_backend.wire.pseudo_terminal import PseudoTerminal
from sim_backend.wire.slcan_adapter import SlcanAdapter
from sim_backend.wire.wire import Wire

MOST = 1000
"""Largest number of CAN frames that one call of `InterfaceWire.from_host` returns."""
BUS_OFF = 0x40
"""Bit in the identifier of an error frame of Linux: the CAN controller is in the state bus-off."""
ERROR_WARNING, BUS_ERROR = 0x04, 0x80
"""Status flags of an slcan adapter. The adapter sets flags instead of sending error frames."""


class CanWire(Wire):
    """Base class of the connections between emulated CAN devices and the host."""

    def __init__(self, devices: Sequence[EmulatedCanDevice]) -> None:
        self.devices = list(devices)

    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Replace the device `old` on the bus by `new`. Do nothing if `old` is not on this bus."""
        if old in self.devices:
            assert isinstance(new, EmulatedCanDevice)
            self.devices = [new if device is old else device for device in self.devices]

    @abstractmethod
    def from_host(self) -> list[can.Message]:
        """Return the CAN frames that the host has sent since the last call."""

    @abstractmethod
    def send(self, frames: list[can.Message]) -> None:
        """Send CAN frames to the host."""

    def due(self) -> float:
        """Return the earliest time [s] at which a device sends a frame without a request."""
        return min((device.due() for device in self.devices), default=math.inf)

    def serve(self, now: float) -> None:
        """Pass all CAN frames that were sent since the last call to their receivers.

        Each device receives the frames of the host and of the other devices. The host receives the
        frames of all devices. A fault changes the frames from and to the host.
        """
        sent = self.from_host()
        if self.to_devices:
            sent = [self.to_devices.frame(f) for f in self.to_devices.frames(sent, now)]
            # only the host receives error frames; without its CAN controller, it cannot send
            is_off = any(f.is_error_frame and f.arbitration_id & BUS_OFF for f in sent)
            sent = [f for f in sent if not (is_off or f.is_error_frame)]
        for frame in sent:
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
        if self.to_host:
            frames = [self.to_host.frame(f) for f in self.to_host.frames(frames, now)]
        self.send(frames)


class SlcanWire(CanWire):
    """A CAN bus to which the host is connected by an emulated slcan adapter.

    An slcan adapter is a CAN adapter on a serial port. Here the serial port is a pseudo-terminal.
    """

    def __init__(self, path: Path, devices: Sequence[EmulatedCanDevice]) -> None:
        super().__init__(devices)
        self.port = PseudoTerminal(path)
        self.adapter = SlcanAdapter()

    def open(self) -> None:
        """Create the pseudo-terminal that the host opens as serial port of the slcan adapter."""
        self.port.open()

    def from_host(self) -> list[can.Message]:
        """Return the CAN frames that the host has sent to the adapter since the last call."""
        data = self.port.read()
        if self.to_devices:
            data = self.to_devices.octets(data) + self.to_devices.noise()
        return self.adapter.receive(data)

    def send(self, frames: list[can.Message]) -> None:
        """Send the answers of the slcan adapter to the host, and then the CAN frames of the bus.

        An error frame (report of a CAN controller about an error on the bus) is not sent. Instead,
        it sets a status flag of the adapter, `BUS_ERROR` for the error bus-off and `ERROR_WARNING`
        for other errors. While `BUS_ERROR` is set, the host receives no CAN frames. The status
        flags are cleared by `close`.
        """
        for error in [frame for frame in frames if frame.is_error_frame]:
            self.adapter.flags |= BUS_ERROR if error.arbitration_id & BUS_OFF else ERROR_WARNING
        if self.adapter.flags & BUS_ERROR:
            frames = []
        heard = [frame for frame in frames if not frame.is_error_frame]
        data = self.adapter.pending() + b"".join(map(self.adapter.encode, heard))
        if self.to_host:
            data = self.to_host.octets(data) + self.to_host.noise()
        self.port.write(data)

    def close(self) -> None:
        """Remove the serial port of the slcan adapter. The adapter loses its settings."""
        self.port.close()
        self.adapter = SlcanAdapter()

    def filenos(self) -> list[int]:
        """Return a list with the file descriptor of the pseudo-terminal; empty if it is closed."""
        return self.port.filenos()

    def host_entries(self) -> dict[str, str | int]:
        """Return the path of the pseudo-terminal."""
        return {"channel": str(self.port.path)}


class InterfaceWire(CanWire):
    """A real or virtual CAN bus that the library python-can opens, for example with SocketCAN.

    The host opens the same bus. `fd`: whether the bus has CAN FD.
    """

    def __init__(
        self, interface: str, channel: str, fd: bool, devices: Sequence[EmulatedCanDevice]
    ) -> None:
        super().__init__(devices)
        self._interface, self._channel, self._fd = interface, channel, fd
        self._bus: can.BusABC | None = None

    def open(self) -> None:
        """Connect to the CAN bus; raise OSError if the bus cannot be opened."""
        try:
            options: dict[str, Any] = {}
            if self._fd:  # the interface `virtual` has an option of its own
                is_virtual = self._interface == "virtual"
                options = {"protocol": can.CanProtocol.CAN_FD} if is_virtual else {"fd": True}
            self._bus = can.Bus(interface=self._interface, channel=self._channel, **options)
        except can.CanError as error:
            raise OSError(str(error)) from error

    def from_host(self) -> list[can.Message]:
        """Return the CAN frames that the host has sent since the last call.

        At most `MOST` frames are returned. Frames of other nodes on the bus are included.
        """
        frames: list[can.Message] = []
        while self._bus and len(frames) < MOST and (frame := self._bus.recv(0)):
            frames.append(frame)
        return frames

    def send(self, frames: list[can.Message]) -> None:
        """Send CAN frames to the bus, and so to the host. Frames that cannot be sent are lost."""
        for frame in frames if self._bus else ():
            assert self._bus
            with contextlib.suppress(can.CanError, OSError):
                self._bus.send(frame)

    def close(self) -> None:
        """Disconnect from the CAN bus."""
        if self._bus:
            self._bus.shutdown()
        self._bus = None

    def filenos(self) -> list[int]:
        """Return a list with the file descriptor of the bus; empty if the bus has none."""
        number = -1
        if self._bus:
            with contextlib.suppress(NotImplementedError):
                number = self._bus.fileno()
        return [number] if number >= 0 else []

    def host_entries(self) -> dict[str, str | int]:
        """Return the channel of the bus, which is that of the rig file."""
        return {"channel": self._channel}
