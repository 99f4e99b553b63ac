"""python-can and can-utils understand each other through the kernel."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import can
import pytest

from drivers.rig import RigError
from drivers.transports.can_bus import CanBus

pytestmark = pytest.mark.socketcan

FRAMES = {
    "123#DEADBEEF": can.Message(
        arbitration_id=0x123, is_extended_id=False, data=b"\xde\xad\xbe\xef"
    ),
    "7FF#": can.Message(arbitration_id=0x7FF, is_extended_id=False),
    "00000123#0102030405060708": can.Message(arbitration_id=0x123, data=range(1, 9)),
    "1FFFFFFF#00": can.Message(arbitration_id=0x1FFFFFFF, data=b"\0"),
    "123#R4": can.Message(arbitration_id=0x123, is_extended_id=False, is_remote_frame=True, dlc=4),
    "20000004#000C000000000000": can.Message(
        arbitration_id=0x4, is_extended_id=False, is_error_frame=True, data=b"\0\x0c\0\0\0\0\0\0"
    ),
}
each_frame = pytest.mark.parametrize(("text", "message"), FRAMES.items(), ids=FRAMES)


def cansend(interface: str, text: str) -> None:
    subprocess.run(["cansend", interface, text], check=True)


def listeners(interface: str) -> int:
    return Path("/proc/net/can/rcvlist_all").read_text().count(f" {interface} ")


@each_frame
def test_candump_sees_sent_frames(vcan0: str, bus: can.BusABC, text: str, message: can.Message):
    before = listeners(vcan0)
    command = ["candump", "-L", "-n", "1", f"{vcan0},0:0,#FFFFFFFF"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as candump:
        while listeners(vcan0) == before:
            assert candump.poll() is None
            time.sleep(0.01)
        bus.send(message)
        printed, _ = candump.communicate(timeout=10)
    assert printed.split()[1:] == [vcan0, text]


@each_frame
def test_frames_of_cansend_are_received(
    vcan0: str, bus: can.BusABC, text: str, message: can.Message
):
    cansend(vcan0, text)
    received = bus.recv(timeout=10)
    assert received is not None
    assert received.equals(
        message, timestamp_delta=None, check_channel=False, check_direction=False
    )


def test_a_message_is_stamped_when_it_arrives_not_when_it_is_read(vcan0: str, bus: can.BusABC):
    before = time.time()
    cansend(vcan0, "123#00")
    after = time.time()
    received = bus.recv(timeout=10)
    assert received is not None
    assert before <= received.timestamp <= after


def fd_bus(channel: str) -> CanBus:
    return CanBus("drives", time.monotonic, "socketcan", channel, None, {}, fd=True)


def test_fd_frames_go_both_ways(vcan0: str):
    received: list[can.Message] = []
    controller = fd_bus(vcan0)
    controller.attach([0x123], lambda frame, now: received.append(frame))
    controller.open()
    with can.Bus(vcan0, interface="socketcan", fd=True) as device:
        controller.send(0x123, bytes(64), fd=True, bitrate_switch=True)
        sent = device.recv(timeout=10)
        assert sent is not None
        assert (len(sent.data), sent.is_fd, sent.bitrate_switch) == (64, True, True)
        cansend(vcan0, "123##1" + 12 * "AB")
        assert controller.wait_for(lambda: received, 10)
        assert received[0].data == 12 * b"\xab"
        assert received[0].is_fd
    controller.close()


def test_an_interface_without_fd_is_refused(vcan0: str):
    subprocess.run(["ip", "link", "add", "vcan9", "mtu", "16", "up", "type", "vcan"], check=True)
    try:
        with pytest.raises(RigError, match=r"CAN bus vcan9 \(socketcan\) has no CAN FD"):
            fd_bus("vcan9").open()
    finally:
        subprocess.run(["ip", "link", "delete", "vcan9"], check=True)


def test_messages_arrive_in_order(vcan0: str, bus: can.BusABC):
    for number in range(10):
        cansend(vcan0, f"123#{number:02X}")
    assert [bus.recv(timeout=10).data[0] for _ in range(10)] == list(range(10))
