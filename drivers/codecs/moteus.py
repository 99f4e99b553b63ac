"""Encode and decode CAN FD frames of moteus motor controllers of mjbots.

A frame contains subframes, which write or read registers. The identifier of a frame is source << 8
| destination, and bit 15 requests a reply. Numbers are little-endian. See "CAN Protocol" and
"Register Reference" in the documentation of moteus. The registers have the meaning of register map
version 5.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

MAP_VERSION = 5
"""Register map version that this module knows."""
EXTENDED = 1 << 31
"""Bit that is set in an identifier of 29 bits, as in DBC files."""
NOP = 0x50
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


class Mode(IntEnum):
    """Modes of a controller."""

    STOPPED = 0
    FAULT = 1
    POSITION = 10
    TIMEOUT = 11


class Register(IntEnum):
    """Registers of a controller."""

    MODE = 0x000
    POSITION = 0x001
    VELOCITY = 0x002
    TORQUE = 0x003
    FAULT = 0x00F
    COMMAND_POSITION = 0x020
    MAX_TORQUE = 0x025
    WATCHDOG = 0x027
    ILIMIT_SCALE = 0x02B
    MODEL = 0x100
    FIRMWARE = 0x101
    MAP_VERSION = 0x102
    SERIAL = 0x120


MODES = {
    0: "stopped",
    1: "fault",
    5: "PWM",
    6: "voltage",
    7: "voltage FOC",
    8: "voltage DQ",
    9: "current",
    10: "position",
    11: "timeout",
    12: "zero velocity",
    13: "stay within",
    14: "measure inductance",
    15: "brake",
}
ENABLING = (2, 3, 4)
"""Modes in which a controller prepares to operate."""
FAULTS = {
    32: "calibration fault",
    33: "motor driver fault",
    34: "over voltage",
    35: "encoder fault",
    36: "motor not configured",
    37: "PWM cycle overrun",
    38: "over temperature",
    39: "outside limit",
    40: "under voltage",
    41: "configuration changed",
    42: "commutation encoder invalid",
    43: "output encoder invalid",
    44: "driver enable fault",
    45: "stop position deprecated",
    46: "timing violation",
    47: "back-EMF feedforward without acceleration limit",
    48: "invalid limits",
}

QUERY = bytes([0x11, Register.MODE, 0x1F, Register.POSITION, 0x11, Register.FAULT])
"""Subframes that read mode, position, velocity, torque and fault code."""
READ_MODEL, READ_FIRMWARE, READ_MAP_VERSION = (bytes([0x19, 0x80 | n, 0x02]) for n in range(3))
IDENTIFY = bytes([0x1B, 0x80, 0x02, 0x1B, 0xA0, 0x02])
"""Subframes that read model, firmware version, register map version and serial number."""
VALUES = ("b", "h", "i", "f")
"""Formats of the types int8, int16, int32 and float."""


class Reply(NamedTuple):
    """Content of a frame of a controller."""

    values: dict[int, float]
    """Values by register, as they are transmitted."""
    refused: tuple[int, ...]
    """Registers that could not be written or read."""


def identifier(source: int, destination: int, reply: bool = False) -> int:
    """Return the identifier of a frame from a node to a node."""
    return (source | reply * 0x80) << 8 | destination


def stop(read: bytes) -> bytes:
    """Return the frame that stops the controller and clears its faults.

    `read`: subframe that reads one more register, by which the reply to this frame is known.
    """
    return padded(bytes([0x01, Register.MODE, Mode.STOPPED]) + QUERY + read)


def velocity(turns_per_s: float, most_torque: float, watchdog: float) -> bytes:
    """Return the frame that commands a velocity [rev/s] with a limited torque [N m].

    `watchdog`: watchdog time [s]. The limits of velocity and acceleration of the controller's
    own trajectories are switched off.
    """
    return padded(
        bytes([0x01, Register.MODE, Mode.POSITION])
        + floats(Register.COMMAND_POSITION, math.nan, turns_per_s)
        + floats(Register.MAX_TORQUE, most_torque)
        + floats(Register.WATCHDOG, watchdog, -1.0, -1.0)
        + QUERY
    )


def torque(newton_metres: float, most_torque: float, watchdog: float) -> bytes:
    """Return the frame that commands a torque [N m]. All gains of the position loop are 0."""
    return padded(
        bytes([0x01, Register.MODE, Mode.POSITION])
        + floats(Register.COMMAND_POSITION, math.nan, 0.0, newton_metres, 0.0, 0.0, most_torque)
        + floats(Register.WATCHDOG, watchdog)
        + floats(Register.ILIMIT_SCALE, 0.0)
        + QUERY
    )


def floats(register: int, *values: float) -> bytes:
    """Return the subframe that writes floats to a register and those after it."""
    count = len(values)
    head = bytes([0x0C | count]) if count < 4 else bytes([0x0C, count])
    return head + bytes([register]) + struct.pack(f"<{count}f", *values)


def padded(data: bytes) -> bytes:
    """Return the data with NOPs at the end, so that they have a length of CAN FD frames."""
    length = next(length for length in FD_LENGTHS if length >= len(data))
    return data.ljust(length, bytes([NOP]))


def decode(data: bytes) -> Reply | None:
    """Return the content of a frame of a controller; None if it is malformed."""
    values: dict[int, float] = {}
    refused: list[int] = []
    try:
        for register, value in subframes(data):
            if value is None:
                refused.append(register)
            else:
                values[register] = value
    except (IndexError, struct.error, ValueError):
        return None
    return Reply(values, tuple(refused))


def subframes(data: bytes) -> Iterator[tuple[int, float | None]]:
    """Yield each register of a frame with its value, or with None if it was refused."""
    at = 0
    while at < len(data):
        kind, at = data[at], at + 1
        if kind == NOP:
            continue
        if kind in (0x30, 0x31):
            register, at = varuint(data, at)
            _, at = varuint(data, at)
            yield register, None
            continue
        if not 0x20 <= kind <= 0x2F:
            raise ValueError(f"unknown subframe {kind:#x}")
        count = kind & 3
        if not count:
            count, at = varuint(data, at)
        register, at = varuint(data, at)
        layout = struct.Struct(f"<{min(count, 64)}{VALUES[kind >> 2 & 3]}")
        for offset, value in enumerate(layout.unpack_from(data, at)):
            yield register + offset, value
        at += layout.size


def varuint(data: bytes, at: int) -> tuple[int, int]:
    """Return the number of variable length at an index, and the index after it."""
    value = shift = 0
    while True:
        byte, at = data[at], at + 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, at
        if shift > 28:
            raise ValueError("number of more than 5 bytes")


def version_text(firmware: int) -> str:
    """Return the firmware version as text."""
    return f"{firmware >> 16 & 0xFF}.{firmware >> 8 & 0xFF}.{firmware & 0xFF}"


DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"


def serial_text(words: tuple[int, int, int]) -> str:
    """Return a serial number of three words as 16 digits, as `moteus_tool --info` prints it."""
    number = 0
    for word in words:
        number = number << 32 | (word & 0xFFFFFFFF)
    return "".join(DIGITS[number >> shift & 63] for shift in range(90, -1, -6))


def fault_text(mode: int, fault: int) -> str:
    """Return the fault of a controller as text; empty if it is not in the mode fault or timeout."""
    if mode == Mode.TIMEOUT:
        return "its watchdog has expired"
    if mode == Mode.FAULT:
        return FAULTS.get(fault, f"fault {fault}")
    return ""
