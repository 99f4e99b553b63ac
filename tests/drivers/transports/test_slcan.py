"""The slcan bus with the emulated adapter, in memory."""

from __future__ import annotations

import contextlib
from unittest.mock import patch

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.transports import slcan
from drivers.transports.slcan import SlcanBus, StatusFlags
from sim_backend.wire.slcan_adapter import SlcanAdapter

from ...can_frames import frames, same

FRAME = can.Message(arbitration_id=0x181, is_extended_id=False, data=b"\x12\xab")
LINE = b"t181212AB\r"


def pieces(data, lengths):
    """Return the bytes in pieces of these lengths, used cyclically."""
    out = []
    while data:
        for length in lengths:
            out.append(data[:length])
            data = data[length:]
    return [piece for piece in out if piece]


class MemoryPort:
    """A port with an adapter, which returns the waiting bytes in pieces."""

    def __init__(self, adapter, on_bus=()):
        self.adapter = adapter
        self.sent = []
        self.to_read = []

    def read(self, timeout):
        return self.to_read.pop(0) if self.to_read else b""

    def write(self, data, timeout):
        return self.send(data)

    def send(self, data):
        self.sent += self.adapter.receive(data)
        if answer := self.adapter.pending():
            self.to_read.append(answer)
        return len(data)

    def close(self):
        self.adapter = None


@contextlib.contextmanager
def opened(adapter=None, bitrate=500_000, **options):
    """Yield a bus and its port, with an adapter."""
    port = MemoryPort(adapter or SlcanAdapter())
    with patch.object(slcan, "open_port", lambda *_: port):
        bus = SlcanBus("memory", bitrate, **options)
    with bus:
        yield bus, port


def drained(bus, port):
    return [frame for _ in range(len(port.to_read)) for frame in bus.drain()]


@given(st.lists(frames(), max_size=8), st.lists(st.integers(1, 40), min_size=1))
def test_any_frame_is_recovered_from_pieces_of_any_size(messages, lengths):
    with opened() as (bus, port):
        for message in messages:
            bus.send(message)
        assert all(map(same, port.sent, messages))
        assert len(port.sent) == len(messages)
        back = b"".join(port.to_read) + b"".join(map(port.adapter.encode, messages))
        port.to_read = pieces(back, lengths)
        received = drained(bus, port)
        assert all(map(same, received, messages))
        assert len(received) == len(messages)
        assert (bus.malformed, bus.unassigned, bus.unanswered) == (0, 0, 0)
        assert bus.acknowledged == len(messages)


@given(st.lists(st.binary() | st.text("tTrRzZF0189Aa\r\a \n").map(str.encode)))
def test_a_frame_after_any_bytes_is_received(noise):
    with opened() as (bus, port):
        port.to_read = [chunk for chunk in noise if chunk] + [b"\r" + LINE]
        assert same(drained(bus, port)[-1], FRAME)


@given(st.binary(min_size=1).filter(lambda noise: not set(noise) & set(b"\r\a")))
def test_noise_loses_only_the_frame_that_it_changes(noise):
    with opened() as (bus, port):
        port.to_read = [LINE + bytes([0xFF]) + noise + LINE + LINE]
        assert len(bus.drain()) == 2
        assert bus.malformed == 1


MALFORMED = """
    t18 t181 t1812 t181212A t181212ABC t181212AB12345 t8000 t1819112233445566778899 t+812 t1_10
    T200000000 T0000001 r181212AB00 d181212AB F F0G V1013 zz t¹810 +1810
"""


@pytest.mark.parametrize("line", [*MALFORMED.split(), "t18121 AB", "t 810"])
def test_a_malformed_line_is_counted_and_skipped(line):
    with opened() as (bus, port):
        port.to_read = [line.encode() + b"\r" + LINE]
        assert [same(frame, FRAME) for frame in bus.drain()] == [True]
        assert bus.malformed == 1


def test_a_line_without_an_end_is_not_kept():
    with opened() as (bus, port):
        port.to_read = [b"t" * 50_000] * 100
        assert drained(bus, port) == []
        assert len(bus._rest) <= slcan.LINE_LIMIT
        port.to_read = [LINE + LINE]
        assert len(bus.drain()) == 1
        assert bus.malformed == 1


def test_a_time_stamp_of_the_adapter_is_left_out():
    adapter = SlcanAdapter()
    adapter.receive(b"Z1\r")
    adapter.pending()
    with opened(adapter) as (bus, port):
        frame = can.Message(timestamp=1.5, arbitration_id=0x1FF, data=b"\x01\x02\x03")
        assert adapter.encode(frame).endswith(b"05DC\r")
        port.to_read = [adapter.encode(frame)]
        assert same(bus.drain()[0], frame)


def test_a_refused_frame_is_reported_once_and_no_other_frame_is_lost():
    with opened() as (bus, port):
        port.adapter.flags = 0x02
        bus.send(FRAME)
        port.to_read = [LINE + port.to_read[0] + LINE]
        with pytest.raises(can.CanOperationError, match=r"memory: frame t181212AB was refused"):
            bus.recv(0.0)
        port.to_read = [LINE]
        assert len(bus.drain()) == 3
        assert (bus.refused, bus.acknowledged, bus.unanswered) == (1, 0, 0)


def test_of_several_frames_the_refused_one_is_named():
    with opened() as (bus, port):
        for identifier, flags in ((1, 0), (2, 2), (3, 0)):
            port.adapter.flags = flags
            bus.send(can.Message(arbitration_id=identifier, is_extended_id=False))
        port.to_read = [b"".join(port.to_read)]
        with pytest.raises(can.CanOperationError, match="frame t0020 was refused, 1 so far"):
            bus.drain()
        assert bus.acknowledged == 2


def test_answers_to_nothing_are_counted():
    with opened() as (bus, port):
        port.to_read = [b"\a\r" + LINE + b"z\r"]
        assert len(bus.drain()) == 1
        assert bus.unassigned == 3


def test_the_flags_are_those_of_the_last_answer():
    with opened() as (bus, port):
        port.adapter.flags = 0xA4
        assert bus.status() is None
        bus.drain()
        flags = StatusFlags.ERROR_WARNING | StatusFlags.ERROR_PASSIVE | StatusFlags.BUS_ERROR
        assert bus.flags == bus.status() == flags


def test_an_adapter_without_flags_is_no_fault():
    with opened() as (bus, port):
        port.adapter.is_open = False
        bus.status()
        assert bus.drain() == []
        assert (bus.flags, bus.refused) == (None, 1)


def test_drain_applies_the_filters_too():
    with opened(can_filters=[{"can_id": 0x181, "can_mask": 0x7FF}]) as (bus, port):
        port.to_read = [b"t1820\r" + LINE]
        assert [same(frame, FRAME) for frame in bus.drain()] == [True]


@pytest.mark.parametrize(
    "options",
    [
        {"is_fd": True},
        {"is_error_frame": True},
        {"is_extended_id": False, "arbitration_id": 0x800},
        {"arbitration_id": 1 << 29},
        {"data": bytes(9)},
        {"data": b"\x01", "dlc": 2},
    ],
)
def test_frames_that_slcan_does_not_support_are_not_sent(options):
    with (
        opened() as (bus, port),
        pytest.raises(
            ValueError, match="slcan frame .*: expected a classical data or remote frame"
        ),
    ):
        bus.send(can.Message(**options))
    assert port.sent == []


def test_it_opens_an_adapter_left_open_by_a_killed_program():
    adapter = SlcanAdapter()
    adapter.receive(b"S8\rO\rt1812")
    adapter.pending()
    with opened(adapter) as (bus, _):
        assert (adapter.is_open, adapter.bitrate) == (True, 500_000)
        bus.send(FRAME)
        assert bus.drain() == []
        assert (bus.acknowledged, bus.unassigned) == (1, 0)
    assert not adapter.is_open


def test_without_a_bit_rate_the_adapter_keeps_its_own():
    adapter = SlcanAdapter()
    adapter.receive(b"S8\r")
    adapter.pending()
    with opened(adapter, bitrate=None):
        assert (adapter.is_open, adapter.bitrate) == (True, 1_000_000)


def test_a_frame_that_comes_with_the_last_acknowledgement_is_received():
    class Busy(SlcanAdapter):
        def pending(self):
            return super().pending() + self.encode(FRAME)

    with opened(Busy()) as (bus, _):
        assert same(bus.recv(0.0), FRAME)


def test_an_unsupported_slcan_bit_rate_is_an_error():
    with pytest.raises(ValueError, match="slcan bit rate 750000: expected one of 10000, .* 800000"):
        SlcanBus("memory", 750_000)


class Answering(SlcanAdapter):
    """An adapter with another answer to commands with a given start."""

    def __init__(self, command, answer):
        super().__init__()
        self.command, self.answer = command, answer

    def receive(self, data):
        self.asked = data.strip().startswith(self.command)
        return super().receive(data)

    def pending(self):
        own = super().pending()
        return self.answer if self.asked else own


@pytest.mark.parametrize(
    ("command", "answer", "message"),
    [
        (b"C", b"", "'C' .close. is not acknowledged: check that this is the port"),
        (b"C", b"$GPGGA,1*00\r\n", "'C' .close. is not acknowledged: check that this is the port"),
        (b"S", b"", "'S6' is not acknowledged: check that the adapter offers 500000 bit/s"),
        (b"S", b"\a", "'S6' is refused: check that the adapter offers 500000 bit/s"),
        (b"O", b"", "'O' is not acknowledged: check"),
        (b"O", b"\a", "'O' is refused: check"),
    ],
)
def test_an_unacknowledged_command_at_the_start_is_an_error(command, answer, message):
    with (
        patch.multiple(slcan, BOOT=0.03, ANSWER=0.01),
        pytest.raises(can.CanInitializationError, match=f"slcan adapter on memory: {message}"),
        opened(Answering(command, answer)),
    ):
        pass


def test_the_request_to_a_booting_adapter_is_repeated():
    class Booting(SlcanAdapter):
        asked = 0

        def receive(self, data):
            self.asked += 1
            return super().receive(data) if self.asked > 2 else []

    with patch.object(slcan, "ANSWER", 0.01), opened(Booting()) as (_, port):
        assert port.adapter.is_open
