"""Serial line between an emulated device and a host."""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path

from sim_backend.wire.emulated_device import EmulatedDevice, EmulatedSerialDevice
from sim_backend.wire.pseudo_terminal import PseudoTerminal
from sim_backend.wire.wire import Wire

BITS = 10
"""Number of bits per byte on the line, including start and stop bit."""


class SerialWire(Wire):
    """A wire with one device on a pseudo-terminal. Frames arrive after their transmission time.

    Parameters
    ----------
    path
        Path of the port.
    device
        The emulated device.
    baud
        Line rate [bit/s].
    """

    def __init__(self, path: Path, device: EmulatedSerialDevice, baud: int) -> None:
        self.port = PseudoTerminal(path)
        self.device = device
        self._byte_time = BITS / baud
        self._line: deque[tuple[float, bytes]] = deque()
        self._free = 0.0
        """Time at which the transmission of all frames on the line ends [s]."""

    def open(self) -> None:
        """Create the port."""
        self.port.open()

    def serve(self, now: float) -> None:
        """Pass the bytes of the host to the device, and frames of the device to the host.

        A frame is passed to the host when its transmission has ended.
        """
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
        """Replace the old device on the port by the new device."""
        if old is self.device:
            assert isinstance(new, EmulatedSerialDevice)
            self.device = new

    def close(self) -> None:
        """Remove the port, and discard the frames on the line."""
        self.port.close()
        self._line.clear()

    def filenos(self) -> list[int]:
        """Return the file descriptor of the pseudo-terminal."""
        return self.port.filenos()

    def due(self) -> float:
        """Return the time [s] of the device's next frame, or of the next arrival at the host."""
        arrival = self._line[0][0] if self._line else math.inf
        return min(self.device.due(), arrival)
