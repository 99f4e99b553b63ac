"""Base class of the ports that transmit a stream of bytes. The port is read once per tick."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING

from drivers.rig import RigError, reason
from drivers.transports.bus import Bus

if TYPE_CHECKING:
    from drivers.device import SerialDevice

BITS = 10
"""Number of bits on a serial line per byte, including one start bit and one stop bit."""


class StreamPort(Bus):
    """A port with a stream of bytes. The bytes are passed to the function given to `attach`.

    `baud`: rate of the serial line [bit/s]; None if it is not known.
    """

    def __init__(self, name: str, now: Callable[[], float], port: str, baud: int | None) -> None:
        super().__init__(name, now)
        self.port = port
        """Name of the port in messages."""
        self.baud = baud
        self.received = 0
        """Number of received bytes."""
        self.written = 0
        """Number of sent bytes."""
        self._receive: Callable[[bytes, float], object] | None = None
        self._polled = now()

    def attach(self, receive: Callable[[bytes, float], object]) -> None:
        """Register the function to which `poll` passes the bytes and their arrival time [s]."""
        self._receive = receive

    def connect(self, device: SerialDevice) -> None:
        """Pass the received bytes to a device."""
        self.attach(device.receive)

    @property
    def occupied(self) -> float:
        """Time for which the busier direction of the line has carried data so far [s]."""
        return self.line_time(max(self.written, self.received)) if self.baud else math.nan

    @abstractmethod
    def _read(self) -> bytes:
        """Return all bytes that have arrived, without waiting; OSError if the port is gone."""

    @abstractmethod
    def _write(self, data: bytes) -> int:
        """Send as many bytes as possible without waiting, and return the number of sent bytes."""

    def poll(self) -> None:
        """Pass all received bytes to the function that `attach` has registered.

        The arrival time of the bytes is estimated as the mean of the time of this reading and the
        time of the previous reading.
        """
        try:
            data = self._read()
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        now = self.now()
        if data and self.log:
            self.log("<", data.hex())
        if data and self._receive:
            self.received += len(data)
            self._receive(data, 0.5 * (self._polled + now))
        self._polled = now

    def write(self, data: bytes) -> None:
        """Send bytes without waiting."""
        if self.log:
            self.log(">", data.hex())
        try:
            written = self._write(data)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        self.written += written
        if written != len(data):
            raise RigError(f"{self.name}: port {self.port} does not send: its buffer is full")

    def line_time(self, size: int) -> float:
        """Return the time [s] that the serial line needs for `size` bytes; 0 if not known."""
        return BITS * size / self.baud if self.baud else 0.0

    def no_frame_message(self, seconds: float, device: str, baud: int) -> str:
        """Return the error message for a device that sent no valid frame."""
        where = f"no valid frame in {seconds:g} s on {self.name} ({self.port})"
        if not self.received:
            return f"{where}, and no other byte: expected {device} with power on"
        return (
            f"{where}, but {self.received} bytes: expected {device} at {baud} baud, check the "
            "baud rate"
        )

    def _gone(self, error: Exception) -> RigError:
        return RigError(f"{self.name}: port {self.port} is disconnected: {reason(error)}")
