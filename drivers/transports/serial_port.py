"""Use a serial port in a control loop. The port is read once per tick."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from drivers.rig import RigError, reason
from drivers.transports.bulk_port import BusyPortError, PortablePort, open_port
from drivers.transports.stream_port import StreamPort


class SerialPort(StreamPort):
    """A serial port."""

    baud: int

    def __init__(self, name: str, now: Callable[[], float], port: str, baud: int) -> None:
        super().__init__(name, now, port, baud)
        self._opened: PortablePort | None = None

    def open(self) -> None:
        """Open the port, and discard the bytes that have already arrived."""
        try:
            self._opened = open_port(self.port, self.baud)
            self._opened.discard_input()
        except (OSError, ValueError) as error:
            expected = "a serial port, see teleop rig list"
            if isinstance(error, BusyPortError):
                expected = "a port that no other process uses"
            raise RigError(
                f"{self.name}: port {self.port} cannot be opened: {reason(error)}: expected "
                f"{expected}"
            ) from error
        self._polled = self.now()

    def _read(self) -> bytes:
        assert self._opened
        return self._opened.read(0.0)

    def _write(self, data: bytes) -> int:
        assert self._opened
        return self._opened.send(data)

    def close(self) -> None:
        """Close the port."""
        if self._opened:
            with contextlib.suppress(OSError):
                self._opened.close()
        self._opened = None
