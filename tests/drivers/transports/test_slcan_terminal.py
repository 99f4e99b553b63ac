"""The slcan bus, and that of python-can, with the emulated adapter on a pseudo-terminal."""

from __future__ import annotations

import io
import os
import select
import threading
from unittest.mock import patch

import can
import pytest
import serial
from can.interfaces.slcan import slcanBus

from drivers.transports import slcan
from drivers.transports.slcan import SlcanBus
from sim_backend.wire.slcan_adapter import SlcanAdapter

from ...can_frames import same

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs a pseudo-terminal")
SOON = 5.0
FRAME = can.Message(arbitration_id=0x181, is_extended_id=False, data=b"\x12\xab")


class Line:
    """An adapter in a thread on a pseudo-terminal, which returns frames with identifier 7."""

    def __init__(self):
        import tty

        self.leader, follower = os.openpty()
        tty.setraw(follower)
        self.port = os.ttyname(follower)
        os.close(follower)
        self.adapter = SlcanAdapter()
        self.sent = []

    def start(self):
        self.until, self.end = os.pipe()
        self.thread = threading.Thread(target=self.serve)
        self.thread.start()

    def serve(self):
        while self.until not in select.select([self.leader, self.until], [], [])[0]:
            try:
                data = os.read(self.leader, 4096)
            except OSError:  # nobody has opened the port
                select.select([self.until], [], [], 1e-3)
                continue
            new = self.adapter.receive(data)
            self.sent += new
            back = [self.adapter.encode(frame) for frame in new if frame.arbitration_id == 7]
            os.write(self.leader, self.adapter.pending() + b"".join(back))

    def stop(self):
        os.close(self.end)
        self.thread.join()
        os.close(self.until)

    def unplug(self):
        self.stop()
        os.close(self.leader)


@pytest.fixture
def line():
    line = Line()
    line.start()
    yield line
    line.unplug()


@pytest.fixture
def stopped():
    line = Line()
    yield line
    os.close(line.leader)


def without_descriptor(port):
    """Open the bus as on a system without file descriptors of ports."""
    with patch.object(serial.Serial, "fileno", side_effect=io.UnsupportedOperation):
        return SlcanBus(port, 500_000)


def fast(port):
    return SlcanBus(port, 500_000)


def python_can(port):
    return slcanBus(port, bitrate=500_000, sleep_after_open=0.0)


@pytest.mark.parametrize("make", [fast, without_descriptor, python_can])
def test_a_real_port_carries_frames_both_ways(line, make):
    messages = [
        can.Message(arbitration_id=7, is_extended_id=False, data=bytes(range(8))),
        can.Message(arbitration_id=7, data=b"\xff"),
        can.Message(arbitration_id=7, is_remote_frame=True, dlc=5),
    ]
    with make(line.port) as bus:
        for message in messages * 20:
            bus.send(message)
            assert same(bus.recv(SOON), message)
        assert (line.adapter.is_open, line.adapter.bitrate) == (True, 500_000)
    assert all(map(same, line.sent, messages * 20))


def test_an_empty_port_is_no_frame_and_no_fault(line):
    with fast(line.port) as bus:
        assert bus.drain() == []
        assert bus.recv(0.0) is None
        assert bus.recv(0.001) is None


@pytest.mark.parametrize("make", [fast, without_descriptor])
def test_the_error_for_an_unplugged_adapter_has_its_port(make):
    line = Line()
    line.start()
    with make(line.port) as bus:
        line.unplug()
        with pytest.raises(can.CanOperationError, match=rf"{line.port}: the port is disconnected"):
            bus.recv(SOON)
        with pytest.raises(can.CanOperationError, match=rf"{line.port}: the port is disconnected"):
            bus.send(FRAME)


def test_a_bus_that_was_shut_down_raises_and_uses_no_other_file(line):
    bus = fast(line.port)
    bus.shutdown()
    bus.shutdown()
    other = os.open(os.devnull, os.O_RDWR)  # gets the number that the port had
    for use in (bus.drain, bus.status, lambda: bus.send(FRAME), lambda: bus.recv(0.0)):
        with pytest.raises(can.CanOperationError, match="the port is disconnected"):
            use()
    os.close(other)


def fill(bus):
    for _ in range(100_000):
        bus.send(FRAME)


def received(bus):
    """Return the next frame, also if an earlier one was refused."""
    try:
        return bus.recv(SOON)
    except can.CanOperationError:
        return bus.recv(SOON)


def test_an_adapter_that_stops_reading_is_an_error_and_later_gets_whole_frames(line):
    with fast(line.port) as bus:
        line.stop()
        with pytest.raises(can.CanOperationError, match="buffer is full"):
            fill(bus)
        line.start()
        last = can.Message(arbitration_id=7, data=b"last")
        bus.send(last, timeout=SOON)
        assert same(received(bus), last)
        assert all(same(frame, FRAME) for frame in line.sent[:-1])


def test_a_port_without_an_adapter_is_an_error(stopped):
    with (
        patch.multiple(slcan, BOOT=0.02, ANSWER=0.01),
        pytest.raises(can.CanInitializationError, match=rf"{stopped.port}: 'C'"),
    ):
        fast(stopped.port)


def test_a_missing_port_is_an_error():
    with pytest.raises(can.CanInitializationError, match="/dev/none cannot be opened"):
        fast("/dev/none")
