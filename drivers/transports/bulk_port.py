"""Read all waiting bytes of a serial port at once.

On POSIX systems, the port is read by system calls, which are faster. On other systems, and for a
URL of pyserial, it is read by pyserial.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import select
import time

import serial

from drivers.claims import lock_holder, process_text
from drivers.posix import is_posix

CHUNK = 65_536
"""Largest number of bytes per read. One read returns all waiting bytes, which are always fewer."""
POLL_PERIOD = 1e-3
"""Time between two checks for bytes [s], for a port without a function that waits for bytes."""


class BusyPortError(OSError):
    """Error: another process has opened a serial port for exclusive use."""


class PortablePort:
    """Serial port that is accessed only through pyserial.

    It works on every operating system, and with every URL that pyserial accepts.
    """

    def __init__(self, port: serial.Serial) -> None:
        self._port = port

    def read(self, timeout: float | None) -> bytes:
        """Return all bytes that have arrived. If there are none, wait for the first byte.

        `timeout`: None for no limit.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while not (waiting := self._port.in_waiting):
            if deadline is not None and time.monotonic() >= deadline:
                return b""
            time.sleep(POLL_PERIOD)
        return bytes(self._port.read(waiting))

    def write(self, data: bytes, timeout: float) -> int:
        """Write as many bytes as the port accepts in this time, and return their number."""
        taken = self.send(data)
        deadline = time.monotonic() + timeout
        while taken < len(data) and (left := deadline - time.monotonic()) > 0.0:
            self._wait_for_room(left)
            taken += self.send(data[taken:])
        return taken

    def discard_input(self) -> None:
        """Discard all bytes that have arrived."""
        self._port.reset_input_buffer()

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def send(self, data: bytes) -> int:
        """Write as many bytes as the port accepts now, and return the number of written bytes."""
        try:
            return self._port.write(data) or 0
        except serial.SerialTimeoutException:
            return 0

    def _wait_for_room(self, seconds: float) -> None:
        time.sleep(min(POLL_PERIOD, seconds))


class DescriptorPort(PortablePort):
    """Serial port that uses POSIX calls: one to read all bytes, and one to write."""

    def __init__(self, port: serial.Serial) -> None:
        super().__init__(port)
        os.set_blocking(port.fileno(), False)
        self._file = io.FileIO(port.fileno(), "r+", closefd=False)
        """Its methods return None, without the time of an exception, where a call would wait."""

    def read(self, timeout: float | None) -> bytes:
        """Return all bytes that have arrived. If there are none, wait for the first byte.

        See `PortablePort.read` for the timeout. OSError: the port is gone.
        """
        data = self._file.read(CHUNK)
        if data is None and timeout != 0.0 and select.select([self._file], [], [], timeout)[0]:
            data = self._file.read(CHUNK)
        if data == b"":
            raise OSError("end of file")
        return data or b""

    def close(self) -> None:
        """Close the port. The operating system may give the number of its file to another file."""
        self._file.close()
        super().close()

    def send(self, data: bytes) -> int:
        """Write as many bytes as the port accepts now, and return the number of written bytes."""
        return self._file.write(data) or 0

    def _wait_for_room(self, seconds: float) -> None:
        select.select([], [self._file], [], seconds)


def open_port(channel: str, baud: int) -> PortablePort:
    """Open a serial port for exclusive use, with low latency where the driver supports it.

    The result is a `DescriptorPort` if the operating system is POSIX and the port has a file
    descriptor, otherwise a `PortablePort`.
    """
    try:
        # With this inter-byte timeout, POSIX reads without data fail, and b"" is the end of file.
        port = serial.serial_for_url(
            channel, baud, timeout=0, write_timeout=0, inter_byte_timeout=0, exclusive=True
        )
    except OSError as error:
        if error.errno in (errno.EAGAIN, errno.EBUSY):
            raise BusyPortError(f"it is used by {process_text(lock_holder(channel))}") from error
        raise
    with contextlib.suppress(AttributeError, NotImplementedError, ValueError, OSError):
        port.set_low_latency_mode(True)
    with contextlib.suppress(io.UnsupportedOperation):
        if is_posix():
            return DescriptorPort(port)
    return PortablePort(port)
