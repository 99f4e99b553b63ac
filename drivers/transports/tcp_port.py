"""Use a TCP connection in a control loop. The connection is read once per tick."""

from __future__ import annotations

import socket
from collections.abc import Callable

from drivers.rig import RigError, reason
from drivers.transports.stream_port import StreamPort

CONNECTING = 2.0
"""Longest wait for a connection [s]."""
CHUNK = 65_536
"""Largest number of bytes per reading."""


class TcpPort(StreamPort):
    """A TCP connection to a device, or to a serial server with a device on its serial line.

    `baud`: rate of the serial line of a serial server [bit/s]; None for a device without such a
    line.
    """

    def __init__(
        self, name: str, now: Callable[[], float], host: str, tcp_port: int, baud: int | None
    ) -> None:
        super().__init__(name, now, f"{host}:{tcp_port}", baud)
        self._address = host, tcp_port
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """Connect to the device. Its data are sent at once, without waiting for more data."""
        self._claim(f"TCP {self.port}", f"TCP connection to {self.port}")
        try:
            opened = socket.create_connection(self._address, CONNECTING)
        except OSError as error:
            self.close()
            raise RigError(
                f"{self.name}: no TCP connection to {self.port}: {reason(error)}: expected a "
                "device that accepts connections on this port"
            ) from error
        opened.setblocking(False)
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = opened
        self._polled = self.now()

    def _read(self) -> bytes:
        assert self._socket
        try:
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError("the device has closed the connection")
        return data

    def _write(self, data: bytes) -> int:
        assert self._socket
        try:
            return self._socket.send(data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Close the connection."""
        if self._socket:
            self._socket.close()
        self._socket = None
        self._held.close()
