"""A serial port, drained once a tick."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from drivers.rig import RigError, reason
from drivers.transports.bulk_port import PortablePort, open_port
from drivers.transports.bus import Bus

BITS = 10
"""Of a byte on the line."""


class SerialPort(Bus):
    """A serial port; what arrives goes to what is attached.

    Parameters
    ----------
    name
        What the rig file calls it.
    now
        The controller's clock [s].
    port
        Device file, COM port, or a pyserial URL.
    baud
        Line rate [bit/s].
    """

    def __init__(self, name: str, now: Callable[[], float], port: str, baud: int) -> None:
        super().__init__(name, now)
        self.port = port
        self.baud = baud
        self.received = 0
        """Bytes so far."""
        self._receive: Callable[[bytes, float], object] | None = None
        self._opened: PortablePort | None = None
        self._polled = now()

    def attach(self, receive: Callable[[bytes, float], object]) -> None:
        """From now on call `receive` with the bytes that have arrived, and with when [s]."""
        self._receive = receive

    def open(self) -> None:
        """Open the port and empty it."""
        try:
            self._opened = open_port(self.port, self.baud)
            self._opened.discard_input()
        except (OSError, ValueError) as error:
            raise RigError(
                f"{self.name}: port {self.port} cannot be opened: {reason(error)}: expected a "
                "serial port, see teleop rig list"
            ) from error
        self._polled = self.now()

    def poll(self) -> None:
        """Hand on all that has arrived, as of the middle of the time since."""
        data, now = self.drain(), self.now()
        if data and self._receive:
            self.received += len(data)
            self._receive(data, 0.5 * (self._polled + now))
        self._polled = now

    def drain(self) -> bytes:
        """All bytes that have arrived.

        Raises
        ------
        RigError
            The port is gone.
        """
        assert self._opened
        try:
            return self._opened.read(0.0)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error

    def write(self, data: bytes) -> None:
        """Send bytes without waiting.

        Raises
        ------
        RigError
            The port is gone or takes no more: its buffer is full.
        """
        assert self._opened
        try:
            taken = self._opened.write(data, 0.0)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        if taken != len(data):
            raise RigError(f"{self.name}: port {self.port} takes no more, its buffer is full")

    def line_time(self, size: int) -> float:
        """How long so many bytes take on the line [s]."""
        return BITS * size / self.baud

    def no_frame(self, seconds: float, device: str, baud: int) -> str:
        """What to say of a device of which no frame has come in so many seconds."""
        where = f"no valid frame in {seconds:g} s on {self.name} ({self.port})"
        if not self.received:
            return f"{where}, and no other byte: expected {device} that has power"
        return (
            f"{where}, but {self.received} bytes: expected {device} at {baud} baud: is the "
            "baud rate right?"
        )

    def close(self) -> None:
        """Close the port."""
        if self._opened:
            with contextlib.suppress(OSError):
                self._opened.close()
        self._opened = None

    def _gone(self, error: Exception) -> RigError:
        return RigError(f"{self.name}: port {self.port} is gone: {reason(error)}")
