"""Network connections between emulated devices and a host, on the loopback interface."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Sequence
from typing import Any

from sim_backend.wire.emulated_device import (
    EmulatedDatagramDevice,
    EmulatedDevice,
    EmulatedSerialDevice,
)
from sim_backend.wire.page_server import PageServer
from sim_backend.wire.serial_wire import StreamWire
from sim_backend.wire.wire import Wire

LOOPBACK = "127.0.0.1"
CHUNK = 65_536
"""Largest number of bytes per reading."""
MOST = 1000
"""Largest number of datagrams that one call of `UdpWire.serve` reads."""


def free_port(kind: socket.SocketKind) -> int:
    """Return the number of a port of the loopback interface that no program uses now."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def listener(port: int) -> socket.socket:
    """Return a socket that accepts TCP connections at a port of the loopback interface."""
    opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.bind((LOOPBACK, port))
        opened.listen(1)
    except BaseException:
        opened.close()
        raise
    opened.setblocking(False)
    return opened


class UdpWire(Wire):
    """UDP datagrams between one emulated device and the host that has last sent a datagram."""

    def __init__(self, device: EmulatedDatagramDevice) -> None:
        self.device = device
        self._number = free_port(socket.SOCK_DGRAM)
        self._socket: socket.socket | None = None
        self._host: Any = None
        self._web_number = free_port(socket.SOCK_STREAM) if device.pages else 0
        self._web: PageServer | None = None

    def open(self) -> None:
        """Open the port of the device, and that of its web server."""
        opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            opened.bind((LOOPBACK, self._number))
        except OSError:
            opened.close()
            raise
        opened.setblocking(False)
        self._socket = opened
        if self._web_number:
            self._web = PageServer(LOOPBACK, self._web_number, self.device.pages)

    def serve(self, now: float) -> None:
        """Pass the datagrams of the host to the device, and those of the device to the host.

        For a fault, each datagram is one frame.
        """
        sent = self._from_host()
        if fault := self.to_devices:
            sent = [fault.octets(data) for data in fault.frames(sent, now)]
            sent.append(fault.noise())
        for data in filter(None, sent):
            self.device.receive(data, now)
        datagrams = self.device.emit(now)
        if fault := self.to_host:
            datagrams = [fault.octets(data) for data in fault.frames(datagrams, now)]
            datagrams.append(fault.noise())
        if self._socket and self._host:
            for data in filter(None, datagrams):
                with contextlib.suppress(OSError):
                    self._socket.sendto(data, self._host)

    def _from_host(self) -> list[bytes]:
        received: list[bytes] = []
        while self._socket and len(received) < MOST:
            try:
                data, self._host = self._socket.recvfrom(CHUNK)
            except ConnectionResetError:  # on Windows, after a datagram to a closed port
                continue
            except BlockingIOError:
                break
            received.append(data)
        return received

    def exchange(self, old: EmulatedDevice, new: EmulatedDevice) -> None:
        """Replace the device `old` by `new`. Do nothing if `old` is not on this wire."""
        if old is self.device:
            assert isinstance(new, EmulatedDatagramDevice)
            self.device = new

    def close(self) -> None:
        """Close the ports of the device. The datagrams of the host are then refused."""
        if self._web:
            self._web.close()
        self._web = None
        if self._socket:
            self._socket.close()
        self._socket = None

    def filenos(self) -> list[int]:
        """Return a list with the file descriptor of the port; empty if it is closed."""
        return [self._socket.fileno()] if self._socket else []

    def due(self) -> float:
        """Return the time [s] at which the device sends a datagram without a request."""
        return self.device.due()

    def host_entries(self) -> dict[str, str | int]:
        """Return host and port of the device."""
        return {"host": LOOPBACK, "port": self._number}

    def device_entries(self) -> dict[str, dict[str, int]]:
        """Return the port of the web server, if the device has one."""
        return {self.device.name: {"http_port": self._web_number}} if self._web_number else {}


class TcpServer:
    """A TCP port of the loopback interface that accepts one connection at a time.

    It has the methods of a `PseudoTerminal`.
    """

    def __init__(self) -> None:
        self.number = free_port(socket.SOCK_STREAM)
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None

    def open(self) -> None:
        """Accept connections from now on."""
        self._listener = listener(self.number)

    def filenos(self) -> list[int]:
        """Return the file descriptor of the connection, or that of the port without connection."""
        used = self._client or self._listener
        return [used.fileno()] if used else []

    def read(self) -> bytes:
        """Return the bytes that the host has sent since the last call. Do not wait for bytes."""
        if not self._client and self._listener:
            with contextlib.suppress(BlockingIOError):
                self._client, _ = self._listener.accept()
                self._client.setblocking(False)
                self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if not self._client:
            return b""
        try:
            data = self._client.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._hang_up()
        return data

    def write(self, data: bytes) -> None:
        """Send bytes to the host. Bytes are lost without a connection, or if it is full."""
        if data and self._client:
            with contextlib.suppress(OSError):
                self._client.send(data)

    def close(self) -> None:
        """End the connection, and accept no other one."""
        self._hang_up()
        if self._listener:
            self._listener.close()
        self._listener = None

    def _hang_up(self) -> None:
        if self._client:
            self._client.close()
        self._client = None


class TcpWire(StreamWire):
    """A TCP connection between emulated devices and the host.

    `baud`: rate of the line of a serial server; None if the devices have no serial line.
    """

    port: TcpServer

    def __init__(self, devices: Sequence[EmulatedSerialDevice], baud: int | None) -> None:
        self.port = TcpServer()
        super().__init__(devices, baud)

    def host_entries(self) -> dict[str, str | int]:
        """Return host and port of the device."""
        return {"host": LOOPBACK, "port": self.port.number}
