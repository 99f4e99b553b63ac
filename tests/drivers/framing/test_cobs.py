"""COBS compared with published examples, and its properties for any bytes in any pieces."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.framing.cobs import CobsReader, decode, encode

UP_TO = bytes(range(1, 255))
EXAMPLES = [
    ("00", "01 01"),
    ("00 00", "01 01 01"),
    ("00 11 00", "01 02 11 01"),
    ("11 22 00 33", "03 11 22 02 33"),
    ("11 22 33 44", "05 11 22 33 44"),
    ("11 00 00 00", "02 11 01 01 01"),
    (UP_TO.hex(), "ff" + UP_TO.hex()),
    ("00" + UP_TO.hex(), "01 ff" + UP_TO.hex()),
    (UP_TO.hex() + "ff", "ff" + UP_TO.hex() + "02 ff"),
    (UP_TO[1:].hex() + "ff 00", "ff" + UP_TO[1:].hex() + "ff 01 01"),
    (UP_TO[2:].hex() + "ff 00 01", "fe" + UP_TO[2:].hex() + "ff 02 01"),
]
"""Examples of the Wikipedia article on COBS, without delimiters."""


@pytest.mark.parametrize(("plain", "encoded"), EXAMPLES)
def test_published_examples(plain, encoded):
    assert encode(bytes.fromhex(plain)) == bytes.fromhex(encoded)
    assert decode(bytes.fromhex(encoded)) == bytes.fromhex(plain)


BYTES = st.one_of(
    st.binary(max_size=600),
    st.lists(st.sampled_from([b"\0", UP_TO, UP_TO[1:], b"\x01"]), max_size=6).map(b"".join),
)


@given(BYTES)
def test_any_bytes_come_back_and_no_zero_is_on_the_wire(data):
    encoded = encode(data)
    assert b"\0" not in encoded
    assert decode(encoded) == data
    assert len(data) < len(encoded) <= len(data) + 1 + len(data) // 254


@given(st.binary(max_size=80))
def test_decoding_accepts_or_rejects_any_bytes(data):
    try:
        decoded = decode(data)
    except ValueError:
        return
    assert len(decoded) <= len(data)


@pytest.mark.parametrize("malformed", ["00", "02", "05 01 02", "02 11 00", "ff 01"])
def test_invalid_code_bytes_are_refused(malformed):
    with pytest.raises(ValueError, match="expected"):
        decode(bytes.fromhex(malformed))


def cut(data: bytes, places: list[int]) -> list[bytes]:
    ends = [0, *sorted(place % (len(data) + 1) for place in places), len(data)]
    return [data[a:b] for a, b in pairwise(ends)]


@given(st.binary(max_size=120), st.lists(st.integers(0, 1000), max_size=8))
def test_where_the_stream_is_cut_makes_no_difference(data, places):
    whole, parts = Counter(), Counter()
    once = CobsReader(16, whole).feed(data)
    reader = CobsReader(16, parts)
    assert [frame for part in cut(data, places) for frame in reader.feed(part)] == once
    assert parts == whole


def test_it_is_synchronised_after_the_next_zero():
    rejected: Counter[str] = Counter()
    reader = CobsReader(64, rejected)
    late = encode(b"first")[3:] + b"\0"
    assert reader.feed(late + encode(b"second") + b"\0" + encode(b"third")) == [b"second"]
    assert rejected == {"framing": 1}
    assert reader.feed(b"\0\0\0") == [b"third"]


def test_an_endless_frame_is_refused_once_and_not_kept():
    rejected: Counter[str] = Counter()
    reader = CobsReader(64, rejected)
    for _ in range(1000):
        assert not reader.feed(b"\x01" * 100)
    assert len(reader._begun) <= 64
    assert reader.feed(b"\0" + encode(b"next") + b"\0") == [b"next"]
    assert rejected == {"length": 1}
