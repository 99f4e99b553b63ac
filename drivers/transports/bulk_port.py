"""A serial port that is read in bulk: by the system's own calls, or by pyserial's where need be."""

from __future__ import annotations

import contextlib
import io
import os
import select
import time

import serial

CHUNK = 65_536
"""Most bytes taken by one read: more than a kernel keeps of a port."""
NAP = 1e-3
"""Between two looks at a port that cannot be waited for [s]."""


class PortablePort:
    """A serial port by the calls that pyserial has on every system and for every URL."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port

    def read(self, timeout: float | None) -> bytes:
        """All bytes that have arrived; if there are none, wait for some [s], None for ever.

        Raises
        ------
        OSError, ValueError
            The port is gone or closed.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while not (waiting := self._port.in_waiting):
            if deadline is not None and time.monotonic() >= deadline:
                return b""
            time.sleep(NAP)
        return bytes(self._port.read(waiting))

    def write(self, data: bytes, timeout: float) -> int:
        """Write what the port takes within a time [s]; how many bytes it took.

        Raises
        ------
        OSError, ValueError
            The port is gone or closed.
        """
        taken = self._write_some(data)
        if taken < len(data):
            deadline = time.monotonic() + timeout
            while taken < len(data) and (left := deadline - time.monotonic()) > 0.0:
                self._wait_for_room(left)
                taken += self._write_some(data[taken:])
        return taken

    def discard_input(self) -> None:
        """Drop all bytes that have arrived."""
        self._port.reset_input_buffer()

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _write_some(self, data: bytes) -> int:
        try:
            return self._port.write(data) or 0
        except serial.SerialTimeoutException:
            return 0

    def _wait_for_room(self, seconds: float) -> None:
        time.sleep(min(NAP, seconds))


class DescriptorPort(PortablePort):
    """The same by POSIX calls on the file descriptor, at a fifth of the time."""

    def __init__(self, port: serial.Serial) -> None:
        super().__init__(port)
        self._descriptor: int = port.fileno()

    def read(self, timeout: float | None) -> bytes:
        """All bytes that have arrived; if there are none, wait for some [s], None for ever."""
        if not select.select([self._descriptor], [], [], timeout)[0]:
            return b""
        data = os.read(self._descriptor, CHUNK)
        if not data:
            raise OSError("end of file")
        return data

    def close(self) -> None:
        """Close the port; no use of it afterwards reaches another file."""
        self._descriptor = -1
        super().close()

    def _write_some(self, data: bytes) -> int:
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:
            return 0

    def _wait_for_room(self, seconds: float) -> None:
        select.select([], [self._descriptor], [], seconds)


def open_port(channel: str, baud: int) -> PortablePort:
    """Open a serial port for this program alone, with the fastest calls and the least latency.

    Parameters
    ----------
    channel
        Device file, COM port, or a pyserial URL.
    baud
        Line rate [bit/s].

    Raises
    ------
    OSError, ValueError
        It cannot be opened.
    """
    port = serial.serial_for_url(channel, baud, timeout=0, write_timeout=0, exclusive=True)
    with contextlib.suppress(AttributeError, NotImplementedError, ValueError, OSError):
        port.set_low_latency_mode(True)
    with contextlib.suppress(io.UnsupportedOperation):
        if os.name == "posix":
            return DescriptorPort(port)
    return PortablePort(port)
