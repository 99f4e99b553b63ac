"""A serial line between an emulated device and a host."""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path

from sim_backend.wire.emulated_device import EmulatedDevice, EmulatedSerialDevice
from sim_backend.wire.pseudo_terminal import PseudoTerminal
from sim_backend.wire.wire import Wire

BITS = 10
"""Of a byte on a serial line."""


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
