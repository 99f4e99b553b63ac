"""A CAN bus that several processes could open is used by one of them only."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import can
import pytest

from drivers.rig import RigError
from drivers.transports.can_bus import CanBus, frame_text

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs abstract sockets")
CHANNEL = f"bus-of-{os.getpid()}"


class Adapter:
    """An adapter without a lock, as SocketCAN has none."""

    def __init__(self, interface, channel, **options):
        if channel == "missing":
            raise can.CanInitializationError("no such device")
        self.is_open = True

    def shutdown(self):
        self.is_open = False


@pytest.fixture(autouse=True)
def adapters(monkeypatch):
    monkeypatch.setattr(can, "Bus", Adapter)


def bus(channel=CHANNEL, interface="socketcan", **options):
    return CanBus("drives", time.monotonic, interface, channel, None, options)


def refusal(of):
    with pytest.raises(RigError) as refused:
        of.open()
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_an_open_bus_cannot_be_opened_again_until_it_is_closed():
    first, second = bus(), bus(receive_own_messages=True)
    first.open()
    line = refusal(second)
    assert line.startswith(
        f"drives: CAN bus {CHANNEL} (socketcan) is used by process {os.getpid()}"
    )
    assert line.endswith("expected a bus that no other process uses")
    second.close()
    refusal(second)
    first.close()
    second.open()
    second.close()


@pytest.mark.parametrize(
    ("channel", "options"),
    [
        ("239.74.163.2", {"port": 43113}),
        ("239.74.163.2", {"port": "43113"}),
        ("239.74.163.2", {"hop_limit": 2, "fd": False}),
        ("FF15::0A", {}),
    ],
)
def test_another_name_of_the_same_multicast_group_is_the_same_bus(channel, options):
    usual = "ff15::a" if ":" in channel else channel
    first = bus(usual, "udp_multicast")
    first.open()
    assert "is used by process" in refusal(bus(channel, "udp_multicast", **options))
    other = bus(usual, "udp_multicast", port=43114)
    other.open()
    other.close()
    first.close()


def test_other_channels_interfaces_and_adapters_are_other_buses():
    opened = [
        bus(),
        bus(CHANNEL + "-2"),
        bus(interface="ixxat", unique_hardware_id="1"),
        bus(interface="ixxat", unique_hardware_id="2"),
        bus(interface="virtual"),
        bus(interface="virtual"),
    ]
    for one in opened:
        one.open()
    for one in opened:
        one.close()


def test_a_bus_that_could_not_be_opened_is_not_claimed():
    for _ in range(2):
        assert "cannot be opened: no such device" in refusal(bus("missing"))


HOLD = """
import sys, time, can
from drivers.transports.can_bus import CanBus
can.Bus = lambda **given: None
CanBus("drives", time.monotonic, "socketcan", sys.argv[1], None, {}).open()
print(flush=True)
sys.stdin.read()
"""


def test_another_process_is_named_and_its_claim_ends_if_it_is_killed():
    held = bus(CHANNEL + "-held")
    command = [sys.executable, "-c", HOLD, held.channel]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        assert f"is used by process {process.pid} (-c" in refusal(held)
        process.kill()
    held.open()
    held.close()


class Silent(Adapter):
    """An adapter that sends frames, and receives those in `incoming`."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.protocol = can.CanProtocol.CAN_FD
        self.incoming = []

    def send(self, frame):
        pass

    def recv(self, timeout):
        return self.incoming.pop(0) if self.incoming else None


def opened(monkeypatch, bitrate, **options):
    """An open bus, and its adapter."""
    adapters = []
    monkeypatch.setattr(can, "Bus", lambda **given: adapters.append(Silent(**given)) or adapters[0])
    bus = CanBus("drives", time.monotonic, "other", CHANNEL, bitrate, {}, **options)
    bus.open()
    return bus, adapters[0]


def test_the_time_of_a_frame_has_the_largest_number_of_stuff_bits(monkeypatch):
    """The longest frames have 135 and 160 bits (Davis et al., Real-Time Systems 35, 2007)."""
    bus, adapter = opened(monkeypatch, 500_000)
    bus.send(1, bytes(8))
    assert bus.occupied == pytest.approx(135 / 500_000)
    adapter.incoming.append(can.Message(arbitration_id=1, data=bytes(8), is_extended_id=True))
    bus.poll()
    assert bus.occupied == pytest.approx((135 + 160) / 500_000)
    bus.request(1)  # a remote frame has no data
    assert bus.occupied == pytest.approx((135 + 160 + 55) / 500_000)
    bus.close()


def test_the_data_of_a_can_fd_frame_are_sent_with_their_own_bit_rate(monkeypatch):
    bus, _ = opened(monkeypatch, 1_000_000, fd=True, data_bitrate=5_000_000)
    bus.send(1, bytes(64), fd=True, bitrate_switch=True)
    assert 64 * 8 / 5e6 + 25e-6 < bus.occupied < 64 * 8 * 1.25 / 5e6 + 45e-6
    bus.close()


def test_the_load_of_a_bus_with_unknown_bit_rate_is_not_known(monkeypatch):
    bus, _ = opened(monkeypatch, None)
    bus.send(1, b"")
    assert bus.occupied != bus.occupied
    bus.close()


@pytest.mark.parametrize(
    "frame",
    [
        can.Message(arbitration_id=0x1A, data=b"\x01\xff", is_extended_id=False),
        can.Message(arbitration_id=0x1A, data=b"", is_extended_id=True),
        can.Message(arbitration_id=0x7FF, is_remote_frame=True, is_extended_id=False),
        can.Message(arbitration_id=0x12345, data=bytes(12), is_fd=True),
    ],
)
def test_a_logged_frame_has_the_form_of_candump(frame, tmp_path):
    path = tmp_path / "log.log"
    path.write_text(f"(1.0) can0 {frame_text(frame)}\n")
    (read,) = can.CanutilsLogReader(path)
    assert read.equals(frame, timestamp_delta=None, check_channel=False, check_direction=False)


def test_the_frames_in_both_directions_are_logged(monkeypatch):
    bus, adapter = opened(monkeypatch, 500_000)
    logged = []
    bus.log = lambda way, text: logged.append((way, text))
    bus.send(0x12, b"\x01")
    adapter.incoming.append(can.Message(arbitration_id=3, data=b"\x02", is_extended_id=False))
    bus.poll()
    assert logged == [(">", "012#01"), ("<", "003#02")]
    bus.close()
