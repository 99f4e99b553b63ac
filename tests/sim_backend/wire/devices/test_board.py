"""The emulated board. Its common behaviour with the firmware is tested with the driver."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs import board as codec
from drivers.devices.board_settings import BoardSettings
from sim_backend.wire.devices.board import BACKLOG, EmulatedBoard, check_sum, stuffed, unstuffed

SETTINGS = BoardSettings(
    kind="board", bus="usb", force_n_per_count=(1e-3,), velocity_um_per_s_per_count=(1.0,)
)


def make(sense=lambda signal: 0.0):
    mount = SimpleNamespace(sense=sense, drive=lambda *_: None, brake=lambda *_: None)
    return EmulatedBoard("board", SETTINGS, mount)


def streaming(rate=1000, **options):
    board = make(**options)
    frames = codec.frame(codec.HELLO, 0) + codec.frame(
        codec.CONFIGURE, 1, codec.configure(50, rate)
    )
    board.receive(frames, 1.0)
    board.emit(1.0)
    return board


def read(frames):
    return codec.MessageReader().feed(b"".join(frames))


def test_check_value_and_stuffing():
    assert check_sum(b"123456789") == 0x906E
    assert stuffed(b"\x11\x22\x00\x33") == b"\x03\x11\x22\x02\x33"
    assert unstuffed(b"\x03\x11\x22\x02\x33") == b"\x11\x22\x00\x33"
    assert unstuffed(b"\x05\x11") == b""


@pytest.mark.parametrize("late", [1, 3, BACKLOG, 50, 5000])
def test_called_late_it_sends_only_a_few_late_frames(late):
    board = streaming()
    samples = read(board.emit(1.0 + late * 1e-3))
    assert 1 <= len(samples) <= BACKLOG
    assert [b.time - a.time for a, b in pairwise(samples)] == pytest.approx(
        [1000] * (len(samples) - 1), abs=1
    )
    assert samples[-1].time == pytest.approx(1e6 + late * 1e3, abs=1001)


def test_called_several_times_at_once_it_sends_each_sample_once():
    board = streaming()
    frames = [frame for i in range(200) for frame in board.emit(1.0 + (i // 4) * 1e-3)]
    samples = read(frames)
    assert len(samples) == pytest.approx(49, abs=1)
    assert [s.sequence for s in samples] == list(range(3, 3 + len(samples)))


def test_a_reading_beyond_the_converter_saturates():
    board = streaming(sense=lambda signal: 1e12 if signal == "force_0" else -1e12)
    sample = read(board.emit(1.001))[0]
    assert sample.counts[0] == 2**31 - 1
    assert sample.counts[4] == -(2**31 - 1)


def test_an_endless_frame_is_not_kept():
    board = streaming()
    for _ in range(100):
        board.receive(b"\x01" * 1000, 1.0)
    assert len(board._begun) < 100
    board.receive(b"\0", 1.0)
    assert read(board.emit(1.001))[0].rejected == 1


@given(st.lists(st.binary(max_size=60), max_size=20))
def test_any_bytes_are_survived(chunks):
    board = streaming()
    for i, chunk in enumerate(chunks):
        board.receive(chunk, 1.0 + i * 1e-3)
        board.emit(1.0 + i * 1e-3)
    board.receive(b"\0" + codec.frame(codec.HELLO, 9), 2.0)
    assert isinstance(read(board.emit(2.0))[-1], codec.Identity)
