"""The emulated slcan adapter, with slcan of python-can as host."""

from __future__ import annotations

import can
import pytest
from can.interfaces.slcan import slcanBus
from hypothesis import given
from hypothesis import strategies as st

from sim_backend.wire.slcan_adapter import SlcanAdapter

from ...can_frames import frames, same


@pytest.fixture(scope="module")
def host():
    with slcanBus("loop://", sleep_after_open=0.0) as bus:
        yield bus


@pytest.fixture
def adapter():
    return opened()


def opened():
    adapter = SlcanAdapter()
    assert answers(adapter, b"S6\rO\r") == b"\r\r"
    return adapter


def answers(adapter, data):
    adapter.receive(data)
    return adapter.pending()


@given(st.lists(frames(), min_size=1, max_size=5), st.integers(1, 40))
def test_it_decodes_the_bytes_of_python_can_in_pieces_of_any_size(host, messages, length):
    host.flush()
    for message in messages:
        host.send(message)
    data = b""
    while waiting := host.serialPortOrig.in_waiting:
        data += host.serialPortOrig.read(waiting)
    adapter = opened()
    out = []
    for start in range(0, len(data), length):
        out += adapter.receive(data[start : start + length])
    assert len(out) == len(messages)
    assert all(map(same, out, messages))
    kinds = [b"Z\r" if message.is_extended_id else b"z\r" for message in messages]
    assert adapter.pending() == b"".join(kinds)


@given(st.lists(frames(), min_size=1, max_size=5))
def test_python_can_decodes_its_lines(host, messages):
    host.flush()
    adapter = opened()
    host.serialPortOrig.write(b"".join(map(adapter.encode, messages)))
    assert all(same(host.recv(5.0), message) for message in messages)


@given(st.lists(st.binary() | st.text("tTrRzZFSOC0189Aa\r").map(str.encode)))
def test_it_answers_every_line_exactly_once(noise):
    adapter = opened()
    for data in noise:
        adapter.receive(data)
    replies = adapter.pending()
    assert replies.count(b"\r") + replies.count(b"\a") == b"".join(noise).count(b"\r")


def test_a_line_without_an_end_is_not_kept_and_is_refused(adapter):
    assert answers(adapter, b"t" * 100_000) == b""
    assert len(adapter._line) < 100
    assert answers(adapter, b"\r") == b"\a"


def test_an_answer_is_given_once(adapter):
    assert answers(adapter, b"V\r") == b"V1013\r"
    assert adapter.pending() == b""


def test_the_channel_opens_after_a_bit_rate_and_closes():
    adapter = SlcanAdapter()
    assert answers(adapter, b"O\r") == b"\a"
    assert answers(adapter, b"S8\rO\r") == b"\r\r"
    assert (adapter.is_open, adapter.bitrate) == (True, 1_000_000)
    assert answers(adapter, b"O\rS6\r") == b"\a\a"
    assert answers(adapter, b"C\rC\r") == b"\r\a"
    assert not adapter.is_open
    assert answers(adapter, b"S9\r") == b"\a"


def test_while_closed_it_transfers_no_frames():
    adapter = SlcanAdapter()
    assert adapter.receive(b"t1810\r") == []
    assert adapter.pending() == b"\a"
    assert adapter.encode(can.Message()) == b""


@pytest.mark.parametrize(
    "line", [b"t181", b"t1812AB", b"t1811ABCD", b"t8000", b"t1819", b"T200000000", b"r1811AB", b"X"]
)
def test_a_malformed_command_is_refused(adapter, line):
    assert adapter.receive(line + b"\r") == []
    assert adapter.pending() == b"\a"


def test_a_full_queue_is_refused_and_flagged(adapter):
    adapter.flags = 0x02
    assert adapter.receive(b"t1810\r") == []
    assert answers(adapter, b"F\r") == b"\aF02\r"


def test_it_reports_version_serial_number_and_flags(adapter):
    adapter.flags = 0xA4
    assert answers(adapter, b"V\rN\rF\r") == b"V1013\rNTELE\rFA4\r"


def test_time_stamps_are_milliseconds_of_a_minute():
    adapter = SlcanAdapter()
    assert answers(adapter, b"Z1\rS6\rO\r") == b"\r\r\r"
    assert adapter.encode(can.Message(timestamp=61.0, arbitration_id=1)) == b"T00000001003E8\r"
