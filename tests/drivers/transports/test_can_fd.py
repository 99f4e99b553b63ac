"""CAN FD frames on buses of python-can."""

from __future__ import annotations

import time

import can
import pytest

from drivers.rig import RigError
from drivers.transports.can_bus import CanBus
from sim_backend.wire.wire_faults import Truncated, WrongLength

INTERFACES = {"virtual": "fd-test", "udp_multicast": "239.74.163.77"}


@pytest.fixture(params=INTERFACES)
def buses(request):
    """The bus of the controller, and the bus of a device."""
    channel = INTERFACES[request.param]
    bus = CanBus("drives", time.monotonic, request.param, channel, None, {}, fd=True)
    protocol = {"protocol": can.CanProtocol.CAN_FD} if request.param == "virtual" else {}
    try:
        bus.open()
        device = can.Bus(interface=request.param, channel=channel, **protocol)
    except (RigError, OSError, can.CanError) as error:
        pytest.skip(f"no multicast here: {error}")
    yield bus, device
    bus.close()
    device.shutdown()


@pytest.mark.parametrize("length", [0, 8, 12, 64])
def test_fd_frames_go_both_ways(buses, length):
    bus, device = buses
    received = []
    bus.attach([0x123], lambda frame, now: received.append(frame))
    bus.send(0x123, bytes(range(length)), fd=True, bitrate_switch=True)
    sent = device.recv(5.0)
    assert (sent.data, sent.is_fd, sent.bitrate_switch) == (bytes(range(length)), True, True)
    device.send(
        can.Message(arbitration_id=0x123, is_extended_id=False, is_fd=True, data=bytes(length))
    )
    assert bus.wait_for(lambda: received, 5.0)
    assert received[-1].data == bytes(length)
    assert received[-1].is_fd


def test_a_classical_frame_is_still_sent_as_such(buses):
    bus, device = buses
    bus.send(0x12, b"\x01")
    assert not device.recv(5.0).is_fd


@pytest.mark.parametrize("length", [9, 65])
def test_a_length_that_fd_frames_do_not_have_is_an_error_of_the_driver(buses, length):
    with pytest.raises(ValueError, match=f"CAN FD frame of {length} bytes"):
        buses[0].send(1, bytes(length), fd=True)


def test_an_interface_without_fd_is_refused_in_one_line(monkeypatch):
    opened = []

    class Classical:
        protocol = can.CanProtocol.CAN_20

        def __init__(self, **options):
            opened.append(options)

        def shutdown(self):
            opened.clear()

    monkeypatch.setattr(can, "Bus", Classical)
    bus = CanBus("drives", time.monotonic, "old", "can0", 1_000_000, {}, True, 5_000_000)
    for _ in range(2):
        with pytest.raises(RigError) as refused:
            bus.open()
        assert not opened
    assert str(refused.value) == (
        "drives: CAN bus can0 (old) has no CAN FD: expected an interface that was set up with CAN "
        "FD"
    )


def test_both_bit_rates_are_passed_to_the_interface(monkeypatch):
    given = {}

    def opened(**options):
        given.update(options)
        raise OSError("no adapter")

    monkeypatch.setattr(can, "Bus", opened)
    bus = CanBus("drives", time.monotonic, "kvaser", "0", 1_000_000, {"a": 1}, True, 5_000_000)
    with pytest.raises(RigError, match="no adapter"):
        bus.open()
    assert given == {
        "interface": "kvaser",
        "channel": "0",
        "bitrate": 1_000_000,
        "fd": True,
        "data_bitrate": 5_000_000,
        "a": 1,
    }


@pytest.mark.parametrize("length", [0, 1, 7, 8, 12, 24, 64])
@pytest.mark.parametrize("fault", [Truncated, WrongLength])
def test_faults_of_the_wire_make_frames_that_can_exist(fault, length):
    frame = can.Message(arbitration_id=5, is_fd=True, bitrate_switch=True, data=bytes(length))
    changed = fault(1.0).frame(frame)
    assert changed.is_fd
    assert changed.bitrate_switch
    assert len(changed.data) == can.util.dlc2len(can.util.len2dlc(len(changed.data)))
    assert len(changed.data) != length or length == 0
