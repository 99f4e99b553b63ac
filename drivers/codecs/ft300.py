"""Data stream of Robotiq's FT 300 force-torque sensor.

A frame is 0x20 0x4E, six 16-bit integers and the CRC-16/MODBUS of all that, little-endian, a
hundred times a second. See Robotiq's FT 300 instruction manual, section 4.4, "Data Stream"; the
stream is begun by Modbus RTU function 16, section 6.12 of the Modbus application protocol 1.1b3.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from drivers.framing.crc import crc16_modbus
from drivers.framing.fixed_frames import FixedFrameParser

HEADER = b"\x20\x4e"
FRAME = struct.Struct("<2x6hH")
CHECKED = FRAME.size - 2
"""Its end without the check sum."""
NEWTON = 0.01
"""A count of force [N]."""
NEWTON_METRE = 0.001
"""A count of moment [N m]."""

START_STREAM = bytes.fromhex("09 10 019A 0001 02 0200 CDCA")
"""Slave 9, write one register, number 410: 0x0200."""
STOP_STREAM = 50 * b"\xff"
"""Interrupts the stream: so many cover more than two of its periods."""


class Ft300Frame(NamedTuple):
    """What a frame tells."""

    fx: float
    """Force [N], as the two that follow."""
    fy: float
    fz: float
    mx: float
    """Moment [N m], as the two that follow."""
    my: float
    mz: float


class Ft300Parser(FixedFrameParser[Ft300Frame]):
    """Cuts a stream of bytes into frames."""

    header = HEADER
    size = FRAME.size

    def decode(self, frame: bytes) -> Ft300Frame | None:
        """What a frame tells; None if its check sum is wrong."""
        *counts, crc = FRAME.unpack(frame)
        if crc != crc16_modbus(frame[:CHECKED]):
            return None
        forces = (NEWTON * count for count in counts[:3])
        moments = (NEWTON_METRE * count for count in counts[3:])
        return Ft300Frame(*forces, *moments)
