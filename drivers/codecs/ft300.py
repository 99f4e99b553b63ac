"""Data stream of Robotiq's FT 300 force-torque sensor.

A frame is 0x20 0x4E, six 16-bit integers and the CRC-16/MODBUS of all that, little-endian, a
hundred times a second. See Robotiq's FT 300 instruction manual, section 4.4, "Data Stream"; the
stream is begun by Modbus RTU function 16, section 6.12 of the Modbus application protocol 1.1b3.
"""

from __future__ import annotations

import struct
from collections import Counter
from typing import NamedTuple

from drivers.framing.crc import crc16_modbus

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


class Ft300Parser:
    """Cuts a stream of bytes into frames, and finds the next header after noise.

    Parameters
    ----------
    rejected
        Where it counts bytes that belong to no frame: `checksum` for the first byte of a header
        whose frame has a wrong check sum, `noise` for what lies between frames.
    """

    def __init__(self, rejected: Counter[str]) -> None:
        self.rejected = rejected
        self._rest = b""

    def feed(self, data: bytes) -> list[Ft300Frame]:
        """The frames that these bytes complete, the oldest first."""
        frames: list[Ft300Frame] = []
        buffer = self._rest + data
        at = 0
        while True:
            start = buffer.find(HEADER, at)
            end = start if start >= 0 else len(buffer) - buffer.endswith(HEADER[:1], at)
            if end > at:
                self.rejected["noise"] += end - at
            if len(buffer) - end < FRAME.size:
                self._rest = buffer[end:]
                return frames
            *counts, crc = FRAME.unpack_from(buffer, end)
            if crc == crc16_modbus(buffer[end : end + CHECKED]):
                forces = (NEWTON * count for count in counts[:3])
                moments = (NEWTON_METRE * count for count in counts[3:])
                frames.append(Ft300Frame(*forces, *moments))
                at = end + FRAME.size
            else:
                self.rejected["checksum"] += 1
                at = end + 1
