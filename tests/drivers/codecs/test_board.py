"""Messages of the board: the example in the documentation, and malformed bytes."""

from __future__ import annotations

import random
import re
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs import board as codec
from drivers.codecs.board import BoardState, Configured, Identity, MessageReader, Sample
from drivers.framing import cobs

ROOT = Path(__file__).parents[3]
EXAMPLE = {
    name: bytes.fromhex(frame)
    for name, frame in re.findall(
        r"^    ([A-Z]+) +((?:[0-9a-f]{2} ?)+)$",
        (ROOT / "docs" / "serial-protocol.md").read_text(),
        re.MULTILINE,
    )
}


def test_host_messages_are_those_of_the_documentation():
    assert codec.frame(codec.HELLO, 0) == EXAMPLE["HELLO"]
    assert codec.frame(codec.CONFIGURE, 1, codec.configure(50, 1000)) == EXAMPLE["CONFIGURE"]
    assert codec.frame(codec.ENABLE, 2, codec.enable(1)) == EXAMPLE["ENABLE"]
    assert codec.frame(codec.COMMAND, 3, codec.command(0, -5000)) == EXAMPLE["COMMAND"]
    assert codec.frame(codec.DISABLE, 4) == EXAMPLE["DISABLE"]


def test_board_messages_are_decoded_as_documented():
    frames = EXAMPLE["IDENTITY"] + EXAMPLE["CONFIGURED"] + EXAMPLE["SAMPLE"]
    assert MessageReader().feed(frames) == [
        Identity(0, 1000, 1, (1, 0), 0x1234ABCD, 2, 2, 2, 4),
        Configured(1, 2000, 50, 1000),
        Sample(
            3,
            3000,
            BoardState.ENABLED,
            0b10,
            0,
            3,
            0,
            (1000, -1000, 25000, -30000, 0, -5000, 1024, 0, 0, 0),
        ),
    ]


def test_every_bit_error_is_detected():
    for name in ("IDENTITY", "CONFIGURED", "SAMPLE"):
        good = EXAMPLE[name]
        for bit in range(8 * (len(good) - 1)):
            damaged = bytearray(good)
            damaged[bit // 8] ^= 1 << bit % 8
            reader = MessageReader()
            assert reader.feed(bytes(damaged)) == []
            assert reader.rejected.total() >= 1
            assert len(reader.feed(good)) == 1


def sealed(body: bytes) -> bytes:
    return codec.frame(body[0], int.from_bytes(body[1:3], "little"), body[3:])


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (bytes((codec.SAMPLE, 0, 0)) + bytes(52), "message"),
        (bytes((codec.SAMPLE, 0, 0)) + bytes(50), "message"),
        (bytes((codec.IDENTITY, 0, 0)) + bytes(4), "message"),
        (bytes((codec.CONFIGURED, 0, 0)), "message"),
        (bytes((0x7F, 0, 0, 1, 2)), "message"),
        (bytes((codec.HELLO, 0, 0)), "message"),
    ],
)
def test_an_intact_frame_that_is_no_message_is_counted(body, reason):
    reader = MessageReader()
    assert reader.feed(sealed(body)) == []
    assert reader.rejected == {reason: 1}


def test_short_and_damaged_frames_are_counted_by_reason():
    reader = MessageReader()
    assert reader.feed(b"\x02\x01\0" + b"\x06\x81\x01\x01\x01\x01\0" + b"\x09\x01\0") == []
    assert reader.rejected == {"length": 1, "checksum": 1, "framing": 1}


def test_of_another_version_only_the_version_is_decoded():
    body = struct.pack("<BHIB", codec.IDENTITY, 7, 99, 3) + b"anything at all"
    assert MessageReader().feed(sealed(body)) == [Identity(7, 99, 3)]


@pytest.mark.parametrize(
    ("value", "counts"),
    [(1e-3, 1000), (-1e-3, -1000), (0.4e-6, 0), (1e9, 2**31 - 1), (-1e9, -(2**31 - 1))],
)
def test_velocities_in_counts_are_rounded_and_limited_to_the_field(value, counts):
    assert codec.to_counts(value, 1e-6) == counts


@given(st.lists(st.binary(max_size=70), max_size=20))
def test_any_bytes_are_survived_and_the_next_message_is_decoded(chunks):
    reader = MessageReader()
    for chunk in chunks:
        reader.feed(chunk)
    reader.feed(b"\0")
    assert len(reader.feed(EXAMPLE["SAMPLE"])) == 1


def test_thousands_of_mutated_messages_are_survived():
    random_ = random.Random(5)
    reader = MessageReader()
    frames = list(EXAMPLE.values())
    for _ in range(20_000):
        frame = bytearray(random_.choice(frames))
        for _ in range(random_.randint(1, 4)):
            at = random_.randrange(len(frame))
            frame[at : at + random_.randint(0, 2)] = random_.randbytes(random_.randint(1, 2))
        reader.feed(bytes(frame))
    reader.feed(cobs.DELIMITER)
    assert len(reader.feed(EXAMPLE["SAMPLE"])) == 1
    assert reader.rejected.total() > 1000
