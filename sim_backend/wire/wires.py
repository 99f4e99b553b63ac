"""Wires between emulated devices and a host: pseudo-terminals and CAN interfaces."""

from __future__ import annotations

import contextlib
import math
import os
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from pathlib import Path

import can

from sim_backend.wire.emulated import (
    EmulatedCanDevice,
    EmulatedDevice,
    EmulatedSerialDevice,
)
from sim_backend.wire.slcan_adapter import SlcanAdapter
from sim_backend.wire.wire_faults import WireFault

CHUNK = 1 << 16
"""Most bytes that are read at once."""
BITS = 10
"""Of a byte on a serial line."""
MOST = 1000
"""Most CAN frames that are read at once."""
BUS_OFF = 0x40
"""Linux's flag of an error frame that tells that a controller has left the bus."""
ERROR_WARNING, BUS_ERROR = 0x04, 0x80
"""An slcan adapter's flags; it hands on no error frames."""


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


class PseudoTerminal:
    """A pseudo-terminal under a path that stays the same, which a host opens like a port.

    Parameters
    ----------
    path
        Where the port stands, a symbolic link.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ends: tuple[int, ...] = ()

    def open(self) -> None:
        """Plug it in.

        Raises
        ------
        NotImplementedError
            The system has no pseudo-terminals.
        """
        try:
            import pty
            import tty
        except ImportError as error:
            raise NotImplementedError("there are no pseudo-terminals on this system") from error
        device, host = pty.openpty()
        tty.setraw(host)
        os.set_blocking(device, False)
        self._ends = device, host
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(host))

    def filenos(self) -> list[int]:
        """The device's end, while it is plugged in."""
        return list(self._ends[:1])

    def read(self) -> bytes:
        """What the host has sent."""
        with contextlib.suppress(BlockingIOError, OSError, IndexError):
            return os.read(self._ends[0], CHUNK)
        return b""

    def write(self, data: bytes) -> None:
        """Send to the host; what nobody takes is lost, as on a wire."""
        if data:
            with contextlib.suppress(BlockingIOError, OSError, IndexError):
                os.write(self._ends[0], data)

    def close(self) -> None:
        """Unplug it."""
        for end in self._ends:
            os.close(end)
        self._ends = ()
        self.path.unlink(missing_ok=True)


class SerialWire(Wire):
    """A device behind a pseudo-terminal; its frames take their time on the line.

    Parameters
    ----------
    path
        Where the port stands.
    device
        The device.
    baud
        Line rate [bit/s].
    """

    def __init__(self, path: Path, device: EmulatedSerialDevice, baud: int) -> None:
        self.port = PseudoTerminal(path)
        self.device = device
        self._byte_time = BITS / baud
        self._line: deque[tuple[float, bytes]] = deque()
        self._free = 0.0
        """When the line has sent what was put on it [s]."""

    def open(self) -> None:
        """Plug it in."""
        self.port.open()

    def serve(self, now: float) -> None:
        """Hand the device what the host sent, and the host what has come through the line."""
        if data := self.port.read():
            self.device.receive(data, now)
        frames = self.device.emit(now)
        if self.fault:
            frames = [self.fault.octets(frame) for frame in self.fault.frames(frames, now)]
            frames.append(self.fault.noise())
        for frame in frames:
            self._free = max(self._free, now) + len(frame) * self._byte_time
            self._line.append((self._free, frame))
        data = b""
        while self._line and self._line[0][0] <= now:
            data += self._line.popleft()[1]
        self.port.write(data)

    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Put the new device behind the port."""
        if old is self.device:
            assert isinstance(new, EmulatedSerialDevice)
            self.device = new

    def close(self) -> None:
        """Unplug it."""
        self.port.close()
        self._line.clear()

    def filenos(self) -> list[int]:
        """The pseudo-terminal."""
        return self.port.filenos()

    def due(self) -> float:
        """When the device sends next, or the next frame has come through the line [s]."""
        arrival = self._line[0][0] if self._line else math.inf
        return min(self.device.due(), arrival)


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
