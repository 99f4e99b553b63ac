"""CAN frames of Linux compared with those of python-can, and the adapter on a pair of sockets."""

from __future__ import annotations

import socket
import sys

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.transports.can_adapter import (
    CLASSICAL_SIZE,
    MOST,
    PythonCanAdapter,
    SocketCanAdapter,
    packed,
    unpacked,
)
from drivers.transports.can_frame import CanFrame

from ...can_frames import frames

linux = pytest.mark.skipif(sys.platform != "linux", reason="needs the frames of Linux")


@st.composite
def any_frames(draw):
    """Return a classical frame, a CAN FD frame or an error frame of python-can."""
    message = draw(frames())
    if not message.is_remote_frame and draw(st.booleans()):
        length = draw(st.sampled_from((*range(9), 12, 16, 20, 24, 32, 48, 64)))
        message.data = bytearray(draw(st.binary(min_size=length, max_size=length)))
        message.dlc = length
        message.is_fd, message.bitrate_switch = True, draw(st.booleans())
    elif not message.is_remote_frame:
        message.is_error_frame = draw(st.booleans())
    return message


@linux
@given(any_frames())
def test_a_frame_has_the_bytes_of_python_can(message):
    from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame

    frame, theirs = CanFrame.of(message), bytearray(build_can_frame(message))
    theirs[7] = 0  # `len8_dlc`, which has no meaning up to 8
    assert packed(frame) == theirs
    back = unpacked(build_can_frame(message), 0.0)
    assert back == frame
    assert back.dlc == dissect_can_frame(build_can_frame(message))[1]


@given(any_frames())
def test_a_message_of_python_can_comes_back(message):
    assert CanFrame.of(message).message().equals(message)


class OpenedBus:
    """What the adapter uses of an opened bus, and the socket of the other side."""

    def __init__(self):
        self.socket, self.device = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)


@pytest.fixture
def bus():
    opened = OpenedBus()
    yield opened
    opened.socket.close()
    opened.device.close()


@linux
def test_all_waiting_frames_are_returned_in_order_and_nothing_waits(bus):
    adapter = SocketCanAdapter(bus)
    assert adapter.drain() == []
    sent = [CanFrame(number, bytes([number])) for number in range(5)]
    for frame in sent:
        bus.device.send(packed(frame))
    assert adapter.drain() == sent
    assert adapter.drain() == []


@linux
def test_a_full_queue_and_a_missing_interface_are_errors_and_nothing_waits(bus):
    adapter = SocketCanAdapter(bus)
    adapter.put([CanFrame(5, b"\x01"), CanFrame(6)])
    assert bus.device.recv(100) == packed(CanFrame(5, b"\x01"))
    with pytest.raises(OSError, match="temporarily unavailable"):
        adapter.put([CanFrame(5)] * 10_000)
    bus.device.close()
    with pytest.raises(OSError, match="refused|not connected|reset"):
        adapter.put([CanFrame(5)])


@linux
def test_a_frame_that_states_more_data_than_it_has_gives_the_data_that_it_has():
    data = bytes([5, 0, 0, 0, 255, 0, 0, 0]) + bytes(8)
    assert unpacked(data, 0.0) == CanFrame(5, bytes(8))
    assert len(data) == CLASSICAL_SIZE


def test_a_reading_ends_although_the_bus_is_flooded():
    class Flood:
        def recv(self, timeout):
            return can.Message(arbitration_id=5)

    assert len(PythonCanAdapter(Flood()).drain()) == MOST
