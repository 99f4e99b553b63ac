"""A serial port on a pseudo-terminal, with system calls and with pyserial."""

from __future__ import annotations

import io
import os
import sys
import time
from unittest.mock import patch

import pytest
import serial

from drivers.rig import RigError
from drivers.transports.serial_port import SerialPort

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs a pseudo-terminal")


@pytest.fixture(params=["descriptor", "portable"])
def calls(request):
    """Select the functions with which the port is read."""
    if request.param == "descriptor":
        yield
    else:
        with patch.object(serial.Serial, "fileno", side_effect=io.UnsupportedOperation):
            yield


class Terminal:
    """Both ends of a pseudo-terminal, with a serial port on the host's end."""

    def __init__(self):
        import tty

        self.leader, follower = os.openpty()
        tty.setraw(follower)
        self.path = os.ttyname(follower)
        os.close(follower)
        self.port = self.another()

    def another(self):
        return SerialPort("usb", time.monotonic, self.path, 115200)

    def unplug(self):
        if self.leader >= 0:
            os.close(self.leader)
        self.leader = -1


@pytest.fixture
def terminal():
    terminal = Terminal()
    yield terminal
    terminal.port.close()
    terminal.unplug()


@pytest.mark.usefixtures("calls")
def test_bytes_go_both_ways_and_bytes_before_the_opening_are_discarded(terminal):
    os.write(terminal.leader, b"stale")
    received = []
    terminal.port.attach(lambda data, now: received.append(data))
    terminal.port.open()
    terminal.port.poll()
    assert not received
    os.write(terminal.leader, b"new")
    assert terminal.port.wait_for(lambda: received, 5.0)
    assert b"".join(received) == b"new"
    terminal.port.write(b"command")
    assert os.read(terminal.leader, 100) == b"command"


def fill(port):
    for _ in range(100_000):
        port.write(bytes(64))


def test_a_write_to_a_device_that_stopped_reading_is_refused_and_does_not_wait(terminal):
    terminal.port.open()
    for _ in range(2):
        with pytest.raises(RigError, match="does not send: its buffer is full"):
            fill(terminal.port)


@pytest.mark.usefixtures("calls")
def test_a_port_that_is_unplugged_is_named_in_one_line(terminal):
    terminal.port.open()
    terminal.unplug()
    for use in (terminal.port.poll, lambda: terminal.port.write(b"command")):
        with pytest.raises(
            RigError, match=rf"usb: port {terminal.path} is disconnected: "
        ) as refused:
            use()
        assert "\n" not in str(refused.value)


def test_no_second_program_opens_the_port(terminal):
    terminal.port.open()
    other = terminal.another()
    with pytest.raises(RigError, match=f"port {terminal.path} cannot be opened"):
        other.open()
    other.close()


def test_a_port_that_is_not_there_is_named(terminal):
    port = SerialPort("usb", time.monotonic, "/dev/none", 115200)
    with pytest.raises(RigError, match="port /dev/none cannot be opened: no such file"):
        port.open()
    port.close()


def test_a_port_without_a_descriptor_that_accepts_no_bytes_is_reported_as_full():
    port = SerialPort("usb", time.monotonic, "loop://", 9600)
    port.open()
    with pytest.raises(RigError, match="does not send: its buffer is full"):
        port.write(b"command")
    port.close()


@pytest.mark.usefixtures("calls")
def test_a_port_that_is_in_use_is_refused_with_the_process_that_uses_it(terminal):
    terminal.port.open()
    with pytest.raises(RigError) as refused:
        terminal.another().open()
    assert f"port {terminal.path} cannot be opened: it is used by" in str(refused.value)
    assert str(refused.value).endswith("expected a port that no other process uses")
    if sys.platform == "linux":
        assert f"used by process {os.getpid()} (" in str(refused.value)
    terminal.port.close()
    other = terminal.another()
    other.open()
    other.close()
