"""UDP datagrams on the loopback interface."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections import Counter

import pytest

from drivers.rig import RigError
from drivers.transports import datagram_port
from drivers.transports.datagram_port import DatagramPort

HOST = "127.0.0.1"


class Device:
    """A UDP socket that stands for the device, and the port of the controller."""

    def __init__(self):
        self.received = []
        self.rejected = Counter()
        self.sockets = []
        self.socket = self.bound()
        self.port = DatagramPort("tip", time.monotonic, HOST, self.number)
        self.port.attach(lambda data, now: self.received.append((data, now)), self.rejected)

    @property
    def number(self):
        return self.socket.getsockname()[1]

    def bound(self, number=0):
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sockets.append(made)
        made.bind((HOST, number))
        made.settimeout(5.0)
        return made

    def open(self):
        """Open the port, and let the device know its address."""
        self.port.open()
        self.port.send(b"hello")
        data, self.host = self.socket.recvfrom(100)
        assert data == b"hello"

    def send(self, data, of=None):
        (of or self.socket).sendto(data, self.host)

    def wait(self, condition):
        assert self.port.wait_for(condition, 5.0)

    def data(self):
        return [data for data, _ in self.received]


@pytest.fixture
def device():
    device = Device()
    yield device
    device.port.close()
    for made in device.sockets:
        made.close()


@pytest.fixture(params=["stamped", "plain"])
def stamps(request, monkeypatch):
    """Select the function with which datagrams are received."""
    if request.param == "plain":
        monkeypatch.setattr(datagram_port.sys, "platform", "other")
    elif sys.platform != "linux":
        pytest.skip("time stamps of the kernel are used on Linux")


@pytest.mark.usefixtures("stamps")
def test_one_reading_passes_all_datagrams_in_their_order(device):
    device.open()
    for number in range(10):
        device.send(bytes([number]))
    device.wait(lambda: len(device.received) == 10)
    assert device.data() == [bytes([number]) for number in range(10)]
    assert device.port.received == 10


def test_one_reading_is_limited_and_the_next_one_passes_the_rest(device, monkeypatch):
    monkeypatch.setattr(datagram_port, "MOST", 10)
    device.open()
    for number in range(13):
        device.send(bytes([number]))
    time.sleep(0.05)
    device.port.poll()
    assert len(device.received) == 10
    device.port.poll()
    assert device.data() == [bytes([number]) for number in range(13)]


@pytest.mark.skipif(sys.platform != "linux", reason="time stamps of the kernel are used on Linux")
def test_a_datagram_is_stamped_when_it_arrives_not_when_it_is_read(device):
    device.open()
    device.send(b"warm up")  # the kernel begins to stamp a moment after the option is set
    device.wait(lambda: device.received)
    time.sleep(0.05)
    before = time.monotonic()
    device.send(b"x")
    after = time.monotonic()
    time.sleep(0.2)
    device.port.poll()
    assert before - 0.05 < device.received[-1][1] < after + 0.05


def test_without_a_usable_stamp_the_time_is_the_middle_between_two_readings(device, monkeypatch):
    monkeypatch.setattr(datagram_port.sys, "platform", "other")
    now = 5.0
    device.port.now = lambda: now
    device.open()
    device.send(b"x")
    time.sleep(0.01)
    now = 6.0
    device.port.poll()
    assert device.received == [(b"x", 5.5)]


@pytest.mark.usefixtures("stamps")
def test_datagrams_of_another_sender_are_counted_and_not_passed_on(device):
    device.open()
    device.send(b"other", of=device.bound())
    device.wait(lambda: device.rejected)
    device.send(b"own")
    device.wait(lambda: device.received)
    assert device.data() == [b"own"]
    assert device.rejected == {"another sender": 1}


@pytest.mark.skipif(sys.platform != "linux", reason="other systems report no refused datagrams")
def test_a_missing_device_is_an_error_that_names_the_bus(device):
    device.port.open()
    device.socket.close()
    device.port.send(b"hello")
    with pytest.raises(RigError, match=rf"tip: UDP port {HOST}:\d+ refuses datagrams: expected"):
        device.port.wait_for(lambda: False, 5.0)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems report no refused datagrams")
def test_a_device_that_restarts_is_only_silent(device):
    device.open()
    device.send(b"before")
    device.wait(lambda: device.received)
    number = device.number
    device.socket.close()
    for _ in range(3):
        device.port.send(b"lost")
        device.port.poll()
    device.wait(lambda: device.rejected["refused"] >= 2)
    again = device.bound(number)
    device.port.send(b"again")
    assert again.recvfrom(100)[0] == b"again"
    device.send(b"after", of=again)
    device.wait(lambda: len(device.received) == 2)
    assert device.data() == [b"before", b"after"]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems report no refused datagrams")
def test_a_datagram_after_a_refused_one_is_sent(device):
    """Linux reports the refusal at the next call, which then does not send."""
    device.open()
    device.send(b"before")
    device.wait(lambda: device.received)
    number = device.number
    device.socket.close()
    device.port.send(b"refused")
    time.sleep(0.05)
    again = device.bound(number)
    device.port.send(b"sent")
    assert again.recvfrom(100)[0] == b"sent"
    assert device.rejected == {"refused": 1}


@pytest.mark.skipif(os.name != "posix", reason="the error text is that of POSIX")
def test_an_error_of_the_network_names_the_bus(device):
    device.open()

    class Unreachable:
        def sendto(self, data, address):
            raise OSError(101, "network is unreachable")

        recvmsg = recvfrom = sendto

        def close(self): ...

    device.port._socket.close()
    device.port._socket = Unreachable()
    for use in (lambda: device.port.send(b"x"), lambda: device.port._gone(OSError(101, ""))):
        try:
            error = use()
        except RigError as raised:
            error = raised
        assert str(error).startswith(f"tip: UDP port {HOST}:{device.number} is disconnected: ")


def test_the_local_port_and_interface_are_those_of_the_rig_file(device):
    free = device.bound()
    number = free.getsockname()[1]
    free.close()
    port = DatagramPort("tip", time.monotonic, HOST, device.number, HOST, number)
    port.open()
    port.send(b"x")
    assert device.socket.recvfrom(100)[1] == (HOST, number)
    port.close()


@pytest.mark.parametrize(
    ("host", "local"), [("no.such.host.invalid", ("", 0)), (HOST, ("203.0.113.9", 0))]
)
def test_an_address_that_does_not_exist_is_named_in_one_line(host, local):
    port = DatagramPort("tip", time.monotonic, host, 49152, *local)
    with pytest.raises(RigError, match=f"tip: UDP port {host}:49152 cannot be opened: ") as refused:
        port.open()
    assert "\n" not in str(refused.value)
    port.close()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has claims")
def test_an_address_that_is_in_use_is_refused_until_it_is_closed(device):
    device.port.open()
    other = DatagramPort("other", time.monotonic, HOST, device.number)
    with pytest.raises(RigError, match=f"is used by process {os.getpid()} "):
        other.open()
    other.close()
    device.port.close()
    other.open()
    other.close()
