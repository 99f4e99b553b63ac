from __future__ import annotations

import struct
from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs.ft300 import FRAME, START_STREAM, Ft300Frame, Ft300Parser

VECTOR = bytes.fromhex("204e640038ff2c010a00ecff1e00c826")
WRENCH = (1.0, -2.0, 3.0, 0.010, -0.020, 0.030)


def modbus(data: bytes) -> int:
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ 0xA001 * (register & 1)
    return register


def encoded(*counts: int) -> bytes:
    frame = struct.pack("<BB6h", 0x20, 0x4E, *counts)
    return frame + struct.pack("<H", modbus(frame))


def parsed(*chunks: bytes) -> tuple[list[Ft300Frame], Counter[str]]:
    rejected: Counter[str] = Counter()
    parser = Ft300Parser(rejected)
    return [frame for chunk in chunks for frame in parser.feed(chunk)], rejected


def test_reads_the_vector_in_si_units():
    (frame,), rejected = parsed(VECTOR)
    assert frame == pytest.approx(WRENCH)
    assert not rejected


def test_the_request_to_stream_is_valid_modbus():
    assert START_STREAM.hex(" ").upper() == "09 10 01 9A 00 01 02 02 00 CD CA"
    assert modbus(START_STREAM[:-2]).to_bytes(2, "little") == START_STREAM[-2:]


def test_a_bit_error_loses_only_its_frame():
    broken = bytearray(VECTOR)
    broken[5] ^= 0x10
    frames, rejected = parsed(VECTOR + broken + VECTOR)
    assert len(frames) == 2
    assert rejected == {"checksum": 1, "noise": 15}


def test_a_header_in_noise_loses_no_frame():
    frames, rejected = parsed(b"\x20\x4e\x20" + VECTOR)
    assert len(frames) == 1
    assert rejected == {"checksum": 1, "noise": 2}


def test_a_header_may_be_cut_in_the_middle():
    frames, rejected = parsed(b"\xff" + VECTOR[:1], VECTOR[1:])
    assert len(frames) == 1
    assert rejected == {"noise": 1}


@given(
    pieces=st.lists(st.one_of(st.just(VECTOR), st.binary(max_size=30), st.just(b"\x20\x4e"))),
    cuts=st.lists(st.integers(0, 300)),
)
def test_the_pieces_do_not_matter_and_every_byte_is_counted(pieces, cuts):
    stream = b"".join(pieces)
    edges = [0, *sorted(cut for cut in cuts if cut < len(stream)), len(stream)]
    chunks = [stream[a:b] for a, b in pairwise(edges)]
    whole, rejected = parsed(stream)
    assert parsed(*chunks) == (whole, rejected)
    pending = len(stream) - FRAME.size * len(whole) - rejected.total()
    assert 0 <= pending < FRAME.size


@given(st.tuples(*[st.integers(-(2**15), 2**15 - 1)] * 6), st.binary(max_size=99))
def test_every_frame_after_noise_is_found(counts, noise):
    noise = noise.replace(b"\x20", b"\x00")
    frames, rejected = parsed(noise + encoded(*counts))
    units = [0.01] * 3 + [0.001] * 3
    assert frames == [pytest.approx([c * u for c, u in zip(counts, units, strict=True)])]
    assert rejected.total() == len(noise)
