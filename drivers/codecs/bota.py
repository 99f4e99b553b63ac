"""Decode the serial frames of force-torque sensors of Bota Systems (Rokubi, SensONE, MegaONE).

A frame consists of a header byte, 34 bytes of data, and the CRC-16/X.25 of the data. All values are
little-endian. The format is that of `RxFrame` and `DataStatus` in RokubiminiSerialImpl.hpp, a file
of the driver `rokubimini_serial` of Bota Systems.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from drivers.framing.crc import ends_with_x25
from drivers.framing.fixed_frames import FixedFrameParser
from drivers.rig import new_tuple

HEADER = b"\xaa"
FRAME = struct.Struct("<xH6fIf2x")

THROTTLED = 1 << 0
"""Status bit. It is set if the sensor skipped a measurement because its serial line is too slow."""
FAULTS = {
    1 << 1: "overrange",
    1 << 2: "invalid measurements: saturation, or a short or open circuit",
    1 << 3: "raw measurements: strain gauges instead of forces",
}
"""Status bits that mark the measurements of a frame as invalid, with the reason."""
INVALID = sum(FAULTS)

RUN = b"R"
"""Command that ends the configuration mode of the sensor. The sensor then starts to send frames."""


class BotaFrame(NamedTuple):
    """Measurements and status in one frame of a force-torque sensor of Bota Systems."""

    status: int
    """Status bits: `THROTTLED` and the keys of `FAULTS`."""
    fx: float
    """Force along the x axis [N]; `fy` and `fz` are the forces along the y and z axes."""
    fy: float
    fz: float
    mx: float
    """Moment about the x axis [N m]; `my` and `mz` are the moments about the y and z axes."""
    my: float
    mz: float
    timestamp_us: int
    """Time stamp of the sensor's clock [us]. It wraps to zero after 71.6 minutes."""
    temperature: float
    """Temperature of the sensor [degC]."""


def fault(status: int) -> str:
    """Return the reason why the measurements of a frame are invalid.

    The text is empty if the measurements are valid.
    """
    if not status & INVALID:
        return ""
    return ", ".join(words for bit, words in FAULTS.items() if status & bit)


class BotaParser(FixedFrameParser[BotaFrame]):
    """Finds and decodes the frames of a Bota Systems sensor in a stream of bytes."""

    header = HEADER
    size = FRAME.size

    def decode(self, frame: bytes) -> BotaFrame | None:
        """Return the measurements and the status in a frame; None if its checksum is wrong."""
        return new_tuple(BotaFrame, FRAME.unpack(frame)) if ends_with_x25(frame[1:]) else None
