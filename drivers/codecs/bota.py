"""Frames of Bota Systems' serial force-torque sensors (Rokubi, SensONE, MegaONE).

A frame is a header byte, 34 bytes of data and their CRC-16/X.25, little-endian throughout: see
`RxFrame` and `DataStatus` of Bota Systems' driver `rokubimini_serial`, RokubiminiSerialImpl.hpp.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from drivers.framing.crc import crc16_x25
from drivers.framing.fixed_frames import FixedFrameParser

HEADER = b"\xaa"
FRAME = struct.Struct("<xH6fIfH")
CHECKED = FRAME.size - 2
"""Its end without the check sum."""

THROTTLED = 1 << 0
"""The sensor has skipped a measurement: its filter is too short for its line rate."""
FAULTS = {
    1 << 1: "overrange",
    1 << 2: "invalid measurements: saturation, or a short or open circuit",
    1 << 3: "raw measurements: strain gauges instead of forces",
}
"""Status bits whose frames are no measurements."""

RUN = b"R"
"""Command that ends the configuration mode; in that mode the sensor sends no frames."""


class BotaFrame(NamedTuple):
    """What a frame tells."""

    status: int
    fx: float
    """Force [N], as the two that follow."""
    fy: float
    fz: float
    mx: float
    """Moment [N m], as the two that follow."""
    my: float
    mz: float
    timestamp_us: int
    """The sensor's own clock; it wraps around after 71.6 minutes."""
    temperature: float
    """[degC]"""


def fault(status: int) -> str:
    """Why the values of a frame with that status are not to be trusted; empty if they are."""
    return ", ".join(words for bit, words in FAULTS.items() if status & bit)


class BotaParser(FixedFrameParser[BotaFrame]):
    """Cuts a stream of bytes into frames."""

    header = HEADER
    size = FRAME.size

    def decode(self, frame: bytes) -> BotaFrame | None:
        """What a frame tells; None if its check sum is wrong."""
        status, *values, crc = FRAME.unpack(frame)
        return BotaFrame(status, *values) if crc == crc16_x25(frame[1:CHECKED]) else None
