"""Compute checksums of serial frames: two cyclic redundancy checks (CRC) of 16 bits.

Both functions are fast enough for a loop at 1 kHz. A function of the standard library, written in
C, computes the X.25 CRC. This function needs data in which the bits of each byte are reversed. The
Modbus CRC is computed with one table look-up per byte.
"""

from __future__ import annotations

from binascii import crc_hqx

MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
"""Table of reversed bits. The byte at index i is i with its bits reversed."""
X25_REMAINDER = 0x1D0F
"""Value of the CRC register after a frame that ends with its X.25 CRC."""


def crc16_x25(data: bytes) -> int:
    """Return the CRC-16/IBM-SDLC (X.25) of data. For the text `123456789` the CRC is 0x906E.

    The polynomial is 0x1021, least significant bit first. The initial value and the final mask are
    0xFFFF (ITU-T X.25, section 2.2.7.4). In a frame, the CRC follows the data as two bytes, the
    low byte first.
    """
    crc = crc_hqx(data.translate(MIRRORED), 0xFFFF)
    return (MIRRORED[crc & 0xFF] << 8 | MIRRORED[crc >> 8]) ^ 0xFFFF


def ends_with_x25(frame: bytes) -> bool:
    """Return whether the last two bytes of a frame are the CRC of the bytes before, low byte first.

    If so, the CRC register has the same value after every frame (ITU-T X.25, section 2.2.7.4).
    """
    return crc_hqx(frame.translate(MIRRORED), 0xFFFF) == X25_REMAINDER


def modbus_step(byte: int) -> int:
    """Return the Modbus CRC of one byte for the initial value 0.

    The results for all bytes are the table that `crc16_modbus` uses.
    """
    for _ in range(8):
        byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
    return byte


MODBUS_STEPS = tuple(modbus_step(byte) for byte in range(256))
"""Result of `modbus_step` for each byte value."""


def crc16_modbus(data: bytes) -> int:
    """Return the CRC-16/MODBUS of data. For the text `123456789` the CRC is 0x4B37.

    The polynomial is 0x8005, least significant bit first, with the initial value 0xFFFF (MODBUS
    over Serial Line 1.02, section 6.2.2). In a frame, the CRC follows the data as two bytes, the
    low byte first.
    """
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ MODBUS_STEPS[(crc ^ byte) & 0xFF]
    return crc
