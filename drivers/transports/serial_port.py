"""Use a serial port in a control loop. The port is read once per tick."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from drivers.rig import RigError, reason
from drivers.transports.bulk_port import BusyPortError, PortablePort, open_port
from drivers.transports.bus import Bus

BITS = 10
"""Number of bits on the line per byte, including one start bit and one stop bit."""


class SerialPort(Bus):
    """A serial port. The received bytes are passed to the function given to `attach`."""

    def __init__(self, name: str, now: Callable[[], float], port: str, baud: int) -> None:
        super().__init__(name, now)
        self.port = port
        self.baud = baud
        self.received = 0
        """Number of received bytes."""
        self._receive: Callable[[bytes, float], object] | None = None
        self._opened: PortablePort | None = None
        self._polled = now()

    def attach(self, receive: Callable[[bytes, float], object]) -> None:
        """Register the function to which `poll` passes the bytes and their arrival time [s]."""
        self._receive = receive

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

    def poll(self) -> None:
        """Pass all received bytes to the function that `attach` has registered.

        The arrival time of the bytes is estimated as the mean of the time of this reading and the
        time of the previous reading.
        """
        data, now = self.drain(), self.now()
        if data and self._receive:
            self.received += len(data)
            self._receive(data, 0.5 * (self._polled + now))
        self._polled = now

    def drain(self) -> bytes:
        """Return all bytes that have arrived, without waiting."""
        assert self._opened
        try:
            return self._opened.read(0.0)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error

    def write(self, data: bytes) -> None:
        """Send bytes without waiting."""
        assert self._opened
        try:
            written = self._opened.write(data, 0.0)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        if written != len(data):
            raise RigError(f"{self.name}: port {self.port} does not send: its buffer is full")

    def line_time(self, size: int) -> float:
        """Return the time [s] that the port needs to transmit `size` bytes."""
        return BITS * size / self.baud

    def no_frame_message(self, seconds: float, device: str, baud: int) -> str:
        """Return the error message for a device that sent no valid frame."""
        where = f"no valid frame in {seconds:g} s on {self.name} ({self.port})"
        if not self.received:
            return f"{where}, and no other byte: expected {device} with power on"
        return (
            f"{where}, but {self.received} bytes: expected {device} at {baud} baud, check the "
            "baud rate"
        )

    def close(self) -> None:
        """Close the port."""
        if self._opened:
            with contextlib.suppress(OSError):
                self._opened.close()
        self._opened = None

    def _gone(self, error: Exception) -> RigError:
        return RigError(f"{self.name}: port {self.port} is disconnected: {reason(error)}")
