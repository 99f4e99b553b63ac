"""A serial port, drained once a tick."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable

import serial

from drivers.device import SerialDevice
from drivers.rig import RigError
from drivers.transports.bus import Bus

CHUNK = 1 << 16
"""Most bytes that are taken at once: more than a kernel keeps of a port."""

EXCLUSIVE = True if os.name == "posix" else None
"""No second program has the port; Windows grants no other way."""
BITS = 10
"""Of a byte on the line."""


class SerialPort(Bus):
    """A serial port and the device behind it.

    Parameters
    ----------
    name
        What the rig file calls it.
    now
        The controller's clock [s].
    port
        Device file, or COM port.
    baud
        Line rate [bit/s].
    """

    def __init__(self, name: str, now: Callable[[], float], port: str, baud: int) -> None:
        super().__init__(name, now)
        self.port = port
        self.baud = baud
        self.device: SerialDevice | None = None
        self.received = 0
        """Bytes so far."""
        self._serial: serial.Serial | None = None
        self._polled = now()

    def open(self) -> None:
        """Open the port, empty it, and ask its driver for low latency where it knows that."""
        try:
            opened = serial.Serial(
                self.port, self.baud, timeout=0, write_timeout=0, exclusive=EXCLUSIVE
            )
            self._serial = opened
            opened.reset_input_buffer()
        except (serial.SerialException, OSError, ValueError) as error:
            raise RigError(
                f"{self.name}: port {self.port} cannot be opened: {reason(error)}: expected a "
                "serial port, see teleop rig list"
            ) from error
        with contextlib.suppress(OSError, ValueError, NotImplementedError, AttributeError):
            opened.set_low_latency_mode(True)
        self._polled = self.now()

    def poll(self) -> None:
        """Hand all that has arrived to the device, as of the middle of the time since."""
        data, now = self.drain(), self.now()
        if data and self.device:
            self.received += len(data)
            self.device.receive(data, 0.5 * (self._polled + now))
        self._polled = now

    def drain(self) -> bytes:
        """All bytes that have arrived.

        Raises
        ------
        RigError
            The port is gone.
        """
        assert self._serial
        try:
            return bytes(self._serial.read(CHUNK))
        except (serial.SerialException, OSError, TypeError) as error:
            raise self._gone(error) from error

    def write(self, data: bytes) -> None:
        """Send bytes without waiting.

        Raises
        ------
        RigError
            The port is gone or takes no more: its buffer is full.
        """
        assert self._serial
        try:
            taken = self._serial.write(data)
        except (serial.SerialException, OSError, TypeError) as error:
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
        if self._serial:
            with contextlib.suppress(serial.SerialException, OSError):
                self._serial.close()
        self._serial = None

    def _gone(self, error: Exception) -> RigError:
        return RigError(f"{self.name}: port {self.port} is gone: {reason(error)}")


def reason(error: Exception) -> str:
    """What the system says, on one line."""
    number = getattr(error, "errno", None)
    text = os.strerror(number).lower() if number else str(error)
    return " ".join(text.split()).rstrip(".") or type(error).__name__
