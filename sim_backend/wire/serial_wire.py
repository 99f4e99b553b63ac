"""Serial line between emulated devices and a host (the program that controls the devices)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from sim_backend.wire.emulated_device import EmulatedDevice, EmulatedSerialDevice
from sim_backend.wire.pseudo_terminal import PseudoTerminal
from sim_backend.wire.wire import Wire

BITS = 10
"""Number of transmitted bits per byte, including start bit and stop bit."""


class StreamEnd(Protocol):
    """End of a stream of bytes: a pseudo-terminal or a TCP connection."""

    def open(self) -> None:
        """Make the stream available to a host."""

    def read(self) -> bytes:
        """Return the bytes that the host has sent since the last call. Do not wait for bytes."""

    def write(self, data: bytes) -> None:
        """Send bytes to the host."""

    def close(self) -> None:
        """Remove the stream."""

    def filenos(self) -> list[int]:
        """Return the file descriptors that become readable when the host sends data, if any."""


class StreamWire(Wire):
    """A stream of bytes between the emulated devices on one line and the host.

    The host receives a frame of a device only when the time has passed that the transmission of
    the frame takes on a real serial line. `baud`: None for a stream without this time.
    """

    port: StreamEnd

    def __init__(self, devices: Sequence[EmulatedSerialDevice], baud: int | None) -> None:
        self.devices = list(devices)
        self._byte_time = BITS / baud if baud else 0.0
        self._line: deque[tuple[float, bytes]] = deque()
        self._free = 0.0
        """Time at which the last of the stored frames is completely transmitted [s]."""

    def open(self) -> None:
        """Create the port that the host opens."""
        self.port.open()

    def serve(self, now: float) -> None:
        """Pass the bytes of the host to the devices, and frames of the devices to the host.

        A frame of a device is stored until its transmission ends, and is then passed to the host.
        For a fault, all bytes of the host since the last call are one frame.
        """
        data = self.port.read()
        if fault := self.to_devices:
            sent = fault.frames([data] if data else [], now)
            data = b"".join(map(fault.octets, sent)) + fault.noise()
        frames: list[bytes] = []
        for device in self.devices:
            if data:
                device.receive(data, now)
            frames += device.emit(now)
        if fault := self.to_host:
            frames = [fault.octets(frame) for frame in fault.frames(frames, now)]
            frames.append(fault.noise())
        for frame in frames:
            self._free = max(self._free, now) + len(frame) * self._byte_time
            self._line.append((self._free, frame))
        data = b""
        while self._line and self._line[0][0] <= now:
            data += self._line.popleft()[1]
        self.port.write(data)

    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Replace the device `old` by `new`. Do nothing if `old` is not on this line."""
        if old in self.devices:
            assert isinstance(new, EmulatedSerialDevice)
            self.devices = [new if device is old else device for device in self.devices]

    def close(self) -> None:
        """Remove the port, and discard frames that the host has not yet received."""
        self.port.close()
        self._line.clear()

    def filenos(self) -> list[int]:
        """Return the file descriptors that become readable when the host sends data, if any."""
        return self.port.filenos()

    def due(self) -> float:
        """Return the time [s] at which `serve` must next be called.

        This is the time at which a device sends a frame without a request, or the time at which
        the transmission of a stored frame ends, whichever is earlier.
        """
        arrival = self._line[0][0] if self._line else math.inf
        return min([arrival, *(device.due() for device in self.devices)])


class SerialWire(StreamWire):
    """A serial line between emulated devices and the host, on a pseudo-terminal."""

    port: PseudoTerminal

    def __init__(self, path: Path, devices: Sequence[EmulatedSerialDevice], baud: int) -> None:
        self.port = PseudoTerminal(path)
        super().__init__(devices, baud)

    def host_entries(self) -> dict[str, str | int]:
        """Return the path of the pseudo-terminal."""
        return {"port": str(self.port.path)}
