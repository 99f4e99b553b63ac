"""Decode the data stream of Robotiq's FT 300 force-torque sensor.

A frame consists of the bytes 0x20 0x4E, six 16-bit integers (three forces and three moments), and
the CRC-16/MODBUS of all these bytes. All values are little-endian. The sensor sends 100 frames per
second. Robotiq's FT 300 instruction manual describes the stream in section 4.4, "Data Stream". A
Modbus RTU request with function 16 starts it (Modbus application protocol 1.1b3, section 6.12).
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from drivers.framing.crc import crc16_modbus
from drivers.framing.fixed_frames import FixedFrameParser

HEADER = b"\x20\x4e"
FRAME = struct.Struct("<2x6hH")
CHECKED = FRAME.size - 2
"""Length of a frame without its checksum [bytes]."""
NEWTON = 0.01
"""Force per count [N]."""
NEWTON_METRE = 0.001
"""Moment per count [N m]."""

START_STREAM = bytes.fromhex("09 10 019A 0001 02 0200 CDCA")
"""Modbus request that starts the stream. It writes 0x0200 to register 410 of slave 9."""
STOP_STREAM = 50 * b"\xff"
"""Bytes that stop the stream. Their transmission takes longer than two frame periods."""


class Ft300Frame(NamedTuple):
    """Forces and moments in one frame of the FT 300 sensor."""

    fx: float
    """Force along the x axis [N]; `fy` and `fz` are the forces along the y and z axes."""
    fy: float
    fz: float
    mx: float
    """Moment about the x axis [N m]; `my` and `mz` are the moments about the y and z axes."""
    my: float
    mz: float


class Ft300Parser(FixedFrameParser[Ft300Frame]):
    """Finds and decodes the frames of the FT 300 sensor in a stream of bytes."""

    header = HEADER
    size = FRAME.size

    def decode(self, frame: bytes) -> Ft300Frame | None:
        """Return the forces and moments in a frame; None if its checksum is wrong."""
        *counts, crc = FRAME.unpack(frame)
        if crc != crc16_modbus(frame[:CHECKED]):
            return None
        forces = (NEWTON * count for count in counts[:3])
        moments = (NEWTON_METRE * count for count in counts[3:])
        return Ft300Frame(*forces, *moments)
