"""A TCP connection on the loopback interface."""

from __future__ import annotations

import socket
import time

import pytest

from drivers.rig import RigError
from drivers.transports import tcp_port
from drivers.transports.tcp_port import TcpPort

HOST = "127.0.0.1"


class Server:
    """The device's end of a connection, and the port of the controller."""

    def __init__(self):
        self.listener = socket.create_server((HOST, 0))
        self.number = self.listener.getsockname()[1]
        self.port = TcpPort("tip", time.monotonic, HOST, self.number, None)
        self.received = b""
        self.port.attach(self.receive)
        self.client = None

    def receive(self, data, now):
        self.received += data

    def open(self):
        self.port.open()
        self.client, _ = self.listener.accept()

    def close(self):
        self.port.close()
        self.listener.close()
        if self.client:
            self.client.close()


@pytest.fixture
def server():
    server = Server()
    yield server
    server.close()


def test_bytes_go_both_ways_without_waiting(server):
    server.open()
    server.port.poll()
    assert server.received == b""
    server.client.sendall(b"sample")
    assert server.port.wait_for(lambda: server.received == b"sample", 5.0)
    server.port.write(b"command")
    assert server.client.recv(100) == b"command"
    assert server.port._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_a_connection_that_the_device_closes_is_an_error_that_names_the_bus(server):
    server.open()
    server.client.sendall(b"last")
    assert server.port.wait_for(lambda: server.received == b"last", 5.0)
    server.client.close()
    with pytest.raises(RigError) as refused:
        server.port.wait_for(lambda: False, 5.0)
    assert str(refused.value) == (
        f"tip: port {HOST}:{server.number} is disconnected: the device has closed the connection"
    )


def test_a_device_that_stopped_reading_is_an_error_and_nothing_waits(server):
    def fill():
        for _ in range(100_000):
            server.port.write(bytes(4096))

    server.open()
    with pytest.raises(RigError, match="does not send: its buffer is full"):
        fill()


def test_a_device_that_accepts_no_connection_is_named(server):
    server.listener.close()
    with pytest.raises(RigError, match=f"tip: no TCP connection to {HOST}:{server.number}: conn"):
        server.port.open()


def test_a_device_that_does_not_answer_is_named_after_a_time_out(server, monkeypatch):
    monkeypatch.setattr(tcp_port, "CONNECTING", 0.05)

    def silent(address, timeout):
        raise TimeoutError("timed out")

    monkeypatch.setattr(socket, "create_connection", silent)
    with pytest.raises(RigError, match="timed out: expected a device that accepts connections"):
        server.port.open()


def test_the_line_of_a_serial_server_has_its_transmission_time(server):
    assert server.port.line_time(100) == 0.0
    assert TcpPort("tip", time.monotonic, HOST, 4001, 19_200).line_time(96) == pytest.approx(0.05)
