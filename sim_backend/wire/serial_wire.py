"""Serial line between an emulated device and a host (the program that controls the device)."""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path

from sim_backend.wire.emulated_device import EmulatedDevice, EmulatedSerialDevice
from sim_backend.wire.pseudo_terminal import PseudoTerminal
from sim_backend.wire.wire import Wire

BITS = 10
"""Number of transmitted bits per byte, including start bit and stop bit."""


class SerialWire(Wire):
    """A serial line between one emulated device and the host, on a pseudo-terminal.

    The host receives a frame of the device only when the time has passed that the transmission of
    the frame takes on a real serial line.
    """

    def __init__(self, path: Path, device: EmulatedSerialDevice, baud: int) -> None:
        self.port = PseudoTerminal(path)
        self.device = device
        self._byte_time = BITS / baud
        self._line: deque[tuple[float, bytes]] = deque()
        self._free = 0.0
        """Time at which the last of the stored frames is completely transmitted [s]."""

    def open(self) -> None:
        """Create the pseudo-terminal that the host opens as a serial port."""
        self.port.open()

    def serve(self, now: float) -> None:
        """Pass the bytes of the host to the device, and frames of the device to the host.

        A frame of the device is stored until its transmission ends, and is then passed to the host.
        For a fault, all bytes of the host since the last call are one frame.
        """
        data = self.port.read()
        if fault := self.to_devices:
            sent = fault.frames([data] if data else [], now)
            data = b"".join(map(fault.octets, sent)) + fault.noise()
        if data:
            self.device.receive(data, now)
        frames = self.device.emit(now)
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
        """Replace the device `old` by `new`. Do nothing if `old` is not on this serial line."""
        if old is self.device:
            assert isinstance(new, EmulatedSerialDevice)
            self.device = new

    def close(self) -> None:
        """Remove the pseudo-terminal, and discard frames that the host has not yet received."""
        self.port.close()
        self._line.clear()

    def filenos(self) -> list[int]:
        """Return a list with the file descriptor of the pseudo-terminal; empty if it is closed."""
        return self.port.filenos()

    def due(self) -> float:
        """Return the time [s] at which `serve` must next be called.

        This is the time at which the device sends a frame without a request, or the time at which
        the transmission of a stored frame ends, whichever is earlier.
        """
        arrival = self._line[0][0] if self._line else math.inf
        return min(self.device.due(), arrival)
