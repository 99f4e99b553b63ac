"""What a station accepts from the network, through a real UDP port."""

from __future__ import annotations

import random
import socket
import time

import pytest

from teleop.errors import InputError
from teleop.safety import Mode
from teleop.station.address import PORT, Address, parse_address
from teleop.station.datagram import NO_FAULT, SIZE, Datagram, pack
from teleop.station.keys import make_session
from teleop.station.peer import MOST, Peer
from teleop.station.station_port import StationPort

from .network import NONCES, session

KEY = bytes(range(32))
COUNT = 10_000
LOOPBACK = Address(socket.AF_INET, ("127.0.0.1", 0))


@pytest.fixture
def ends():
    """A peer, and a function that sends bytes to it and lets it read."""
    with StationPort(LOOPBACK, listens=True) as port, socket.socket(type=socket.SOCK_DGRAM) as end:
        peer = Peer(port, ("127.0.0.1", 9), session("slave"), time.monotonic)

        def send(*datagrams):
            for data in datagrams:
                end.sendto(data, port.place)
            for _ in range(1000):
                before = sum(peer.rejected.values()) + peer.window.received
                peer.receive()
                if sum(peer.rejected.values()) + peer.window.received == before:
                    return

        yield peer, send


def datagram(number, nonces=NONCES, side="master", position=0.0):
    one = make_session(bytes(range(32)), nonces, side)
    values = (position, 0.0, 0.0)
    sent = time.monotonic()
    return pack(
        Datagram(Mode.ACTIVE, 0, NO_FAULT, one.number, number, sent, 0.0, 0.0, values), one.send_key
    )


def in_blocks(send, datagrams):
    for start in range(0, len(datagrams), 50):
        send(*datagrams[start : start + 50])


def test_genuine_datagrams_are_accepted_in_their_order(ends):
    peer, send = ends
    in_blocks(send, [datagram(n, position=float(n)) for n in range(200)])
    assert peer.newest.values[0] == 199.0
    assert peer.window.received == 200
    assert peer.rejected == {}


def test_an_overtaken_datagram_is_counted_and_not_used(ends):
    peer, send = ends
    send(datagram(0), datagram(2, position=2.0), datagram(1, position=1.0), datagram(5))
    assert peer.newest.sequence == 5
    assert peer.overtaken == 1
    assert peer.window.lost == 2


def test_of_forged_replayed_reflected_changed_and_older_datagrams_none_is_accepted(ends):
    peer, send = ends
    draw = random.Random(1)
    genuine = [datagram(n) for n in range(50)]
    in_blocks(send, genuine)
    accepted = peer.window.received
    older = bytes(reversed(NONCES))
    kinds = {
        "repeated": [draw.choice(genuine) for _ in range(COUNT)],
        "signature": [datagram(n, side="slave") for n in range(COUNT)],  # reflected
        "session": [datagram(n, nonces=older) for n in range(COUNT)],
        "size": [draw.randbytes(draw.randrange(SIZE)) for _ in range(COUNT)],
    }
    for reason, datagrams in kinds.items():
        in_blocks(send, datagrams)
        assert peer.rejected[reason] == COUNT
    changed = []
    for n in range(COUNT):
        data = bytearray(datagram(100 + n))
        data[draw.randrange(SIZE)] ^= 1 << draw.randrange(8)
        changed.append(bytes(data))
    in_blocks(send, changed)
    assert sum(peer.rejected.values()) == 5 * COUNT
    assert peer.window.received == accepted
    assert peer.newest.sequence == 49


def test_a_tick_reads_a_bounded_number_of_datagrams(ends):
    peer, _ = ends
    with socket.socket(type=socket.SOCK_DGRAM) as end:
        for _ in range(2 * MOST):
            end.sendto(b"x" * 40, peer.port.place)
    peer.receive()
    assert 0 < peer.rejected["size"] <= MOST


@pytest.mark.skipif("sys.platform != 'linux'", reason="the time of reception is that of Linux")
def test_the_time_of_reception_is_that_of_the_operating_system(ends):
    peer, send = ends
    send(datagram(0))  # compares the clocks first
    sent = time.monotonic()
    with socket.socket(type=socket.SOCK_DGRAM) as end:
        end.sendto(datagram(1), peer.port.place)
    time.sleep(0.05)
    peer.receive()
    assert peer.heard - sent < 0.04


def test_a_step_of_the_clock_of_the_day_changes_no_time_of_reception(ends, monkeypatch):
    peer, send = ends
    send(datagram(0))
    for step in (3600.0, -3600.0, 0.01, -0.01):
        real = time.time_ns
        monkeypatch.setattr(time, "time_ns", lambda real=real, step=step: real() + int(step * 1e9))
        before = time.monotonic()
        send(datagram(peer.window.newest + 1))
        assert before - 1e-3 <= peer.heard <= time.monotonic()


def test_a_datagram_that_cannot_be_sent_is_counted(ends):
    peer, _ = ends
    peer._place = ("255.255.255.255", 9)  # a broadcast needs a permission
    peer.send(Mode.IDLE, 0, (0.0,) * 7)
    assert peer.port.unsent == 1


# Addresses


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("127.0.0.1", ("127.0.0.1", PORT)),
        ("127.0.0.1:5000", ("127.0.0.1", 5000)),
        ("[::1]:5000", ("::1", 5000)),
        ("::1", ("::1", PORT)),
    ],
)
def test_an_address_has_a_host_and_an_optional_port(text, place):
    assert parse_address(text).place[:2] == place


@pytest.mark.parametrize("text", ["", ":5000", "a b", "127.0.0.1:0", "127.0.0.1:70000", "[::1"])
def test_a_wrong_address_is_told(text):
    with pytest.raises(InputError, match="address"):
        parse_address(text)


def test_a_port_in_use_is_told(ends):
    peer, _ = ends
    used = Address(socket.AF_INET, peer.port.place)
    with pytest.raises(InputError, match="expected a free port"):
        StationPort(used, listens=True)
