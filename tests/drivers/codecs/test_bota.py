from __future__ import annotations

import struct
from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs.bota import FRAME, BotaFrame, BotaParser, fault

VECTOR = bytes.fromhex("aa00000000803f0000004000004040cdcccc3dcdcc4c3e9a99993ee80300000000c841dabb")
WRENCH = (1.0, 2.0, 3.0, 0.1, 0.2, 0.3)


def x25(data: bytes) -> int:
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ 0x8408 * (register & 1)
    return register ^ 0xFFFF


def encoded(*values: float, status: int = 0, stamp: int = 0) -> bytes:
    data = struct.pack("<H6fIf", status, *values, stamp, 25.0)
    return b"\xaa" + data + struct.pack("<H", x25(data))


def parsed(*chunks: bytes) -> tuple[list[BotaFrame], Counter[str]]:
    rejected: Counter[str] = Counter()
    parser = BotaParser(rejected)
    return [frame for chunk in chunks for frame in parser.feed(chunk)], rejected


def test_reads_the_vector_in_si_units():
    (frame,), rejected = parsed(VECTOR)
    assert frame[1:7] == pytest.approx(WRENCH)
    assert (frame.status, frame.timestamp_us, frame.temperature) == (0, 1000, 25.0)
    assert not rejected


def test_the_independent_check_sum_agrees_with_the_vector():
    assert x25(VECTOR[1:35]).to_bytes(2, "little") == VECTOR[35:]


def test_a_bit_error_loses_only_its_frame():
    broken = bytearray(VECTOR)
    broken[9] ^= 4
    frames, rejected = parsed(VECTOR + broken + VECTOR)
    assert len(frames) == 2
    assert rejected["checksum"] >= 1
    assert rejected.total() == len(VECTOR)


def test_a_header_in_noise_loses_no_frame():
    frames, rejected = parsed(b"\xaa\x01" + VECTOR + b"\xaa" + VECTOR)
    assert len(frames) == 2
    assert rejected == {"checksum": 2, "noise": 1}


@pytest.mark.parametrize(
    ("status", "words"),
    [(0, ""), (1, ""), (2, "overrange"), (4, "invalid"), (8, "raw"), (6, "overrange, invalid")],
)
def test_reports_the_fault_of_a_status(status, words):
    assert fault(status).startswith(words)
    assert bool(fault(status)) == bool(words)


@given(
    pieces=st.lists(st.one_of(st.just(VECTOR), st.binary(max_size=60))),
    cuts=st.lists(st.integers(0, 600)),
)
def test_the_pieces_do_not_matter_and_every_byte_is_counted(pieces, cuts):
    stream = b"".join(pieces)
    edges = [0, *sorted(cut for cut in cuts if cut < len(stream)), len(stream)]
    chunks = [stream[a:b] for a, b in pairwise(edges)]
    whole, rejected = parsed(stream)
    assert parsed(*chunks) == (whole, rejected)
    pending = len(stream) - FRAME.size * len(whole) - rejected.total()
    assert 0 <= pending < FRAME.size


@given(
    noise=st.binary(max_size=200).filter(lambda b: b"\xaa" not in b),
    values=st.tuples(*[st.floats(-1e3, 1e3, width=32)] * 6),
    stamp=st.integers(0, 2**32 - 1),
)
def test_every_frame_after_noise_is_found(noise, values, stamp):
    frame = encoded(*values, stamp=stamp)
    frames, rejected = parsed(noise + frame + noise + frame)
    assert [found[1:8] for found in frames] == [(*values, stamp)] * 2
    assert rejected.total() == 2 * len(noise)


def test_the_buffer_for_incomplete_frames_is_bounded():
    rejected: Counter[str] = Counter()
    parser = BotaParser(rejected)
    for _ in range(1000):
        assert parser.feed(b"\xaa" * 100) == []
    assert 100_000 - rejected.total() < FRAME.size
    assert parser.feed(VECTOR)
