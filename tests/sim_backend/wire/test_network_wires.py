"""Emulated UDP and TCP connections: a host on the loopback interface."""

from __future__ import annotations

import socket

import pytest

from sim_backend.wire.emulated_device import EmulatedDatagramDevice, EmulatedSerialDevice, Mount
from sim_backend.wire.network_wires import LOOPBACK, TcpWire, UdpWire
from sim_backend.wire.wire_faults import Corrupted, Doubled, Reordered, Silent


class Bench(Mount):
    def sense(self, signal):
        return 0.0

    def drive(self, name, velocity): ...

    def brake(self, name): ...


class Echo:
    """Answers each datagram, or all bytes since the last call, by the same data."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.answers = []

    def receive(self, data, now):
        self.answers.append(data)

    def emit(self, now):
        out, self.answers = self.answers, []
        return out


class DatagramEcho(Echo, EmulatedDatagramDevice):
    pass


class StreamEcho(Echo, EmulatedSerialDevice):
    pass


@pytest.fixture
def udp():
    wire = UdpWire(DatagramEcho("echo", None, Bench()))
    wire.open()
    yield wire
    wire.close()


@pytest.fixture
def host():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind((LOOPBACK, 0))
        made.settimeout(0.2)
        yield made


def exchange(wire, host, *datagrams):
    """Send the datagrams, serve the wire, and return what the host receives."""
    entries = wire.host_entries()
    for data in datagrams:
        host.sendto(data, (entries["host"], entries["port"]))
    wire.serve(0.0)
    received = []
    try:
        while True:
            received.append(host.recv(100))
    except TimeoutError:
        return received


def test_datagrams_are_answered_to_their_sender_in_order(udp, host):
    assert exchange(udp, host, b"a", b"b") == [b"a", b"b"]


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (lambda: Silent(), []),
        (lambda: Doubled(1.0), [b"a", b"a", b"a", b"a", b"b", b"b", b"b", b"b"]),
    ],
)
def test_faults_apply_to_the_datagrams_of_both_directions(udp, host, fault, expected):
    udp.distort(fault)
    assert exchange(udp, host, b"a", b"b") == expected


def test_datagrams_are_exchanged_and_changed_one_by_one(udp, host):
    udp.to_host = Reordered(1.0)
    assert exchange(udp, host, b"a", b"b") == [b"b", b"a"]
    udp.to_host = Corrupted(1.0)
    changed = exchange(udp, host, b"\0\0", b"\0")
    assert [len(data) for data in changed] == [2, 1]
    assert all(sum(byte.bit_count() for byte in data) == 1 for data in changed)


def test_an_unplugged_port_is_silent_and_has_the_same_number_again(udp, host):
    number = udp.host_entries()["port"]
    udp.close()
    assert udp.filenos() == []
    assert exchange(udp, host, b"a") == []
    udp.open()
    assert udp.host_entries()["port"] == number
    assert exchange(udp, host, b"b") == [b"b"]


def test_a_tcp_wire_serves_one_connection_after_the_other():
    wire = TcpWire([StreamEcho("echo", None, Bench())], None)
    wire.open()
    address = tuple(wire.host_entries().values())
    try:
        for _ in range(2):
            with socket.create_connection(address, 5.0) as host:
                wire.serve(0.0)
                host.sendall(b"abc")
                data = b""
                for _ in range(500):
                    wire.serve(0.0)
                    if len(data) == 3:
                        break
                    host.settimeout(0.01)
                    try:
                        data += host.recv(100)
                    except TimeoutError:
                        continue
                assert data == b"abc"
            wire.serve(0.0)
        with socket.create_connection(address, 5.0) as host:
            wire.serve(0.0)
            wire.close()
            assert host.recv(100) == b""
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(address, 5.0)
    finally:
        wire.close()
