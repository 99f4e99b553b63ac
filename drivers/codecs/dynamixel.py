"""Encode and decode packets of the protocol DYNAMIXEL 2.0, and values of Dynamixel X servos.

See ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0", and the control tables of the X series. A packet is
FF FF FD 00, identifier, length (2 bytes), instruction, parameters and CRC. In a packet from the
servo, the first parameter is the error. If FF FF FD occurs after the length, FD is inserted.
"""

from __future__ import annotations

import struct
from collections import Counter
from typing import NamedTuple

HEADER = b"\xff\xff\xfd\x00"
BROADCAST = 0xFE
READ, WRITE, SYNC_WRITE, STATUS = 0x02, 0x03, 0x83, 0x55
"""Instructions."""
ALERT = 0x80
"""Bit of the error in a packet. It is set if the servo reports a hardware error."""
ERRORS = {
    1: "the instruction failed",
    2: "unknown instruction",
    3: "CRC error",
    4: "data out of range",
    5: "wrong length",
    6: "data beyond a limit",
    7: "no access",
}
HARDWARE_ERRORS = {
    0: "input voltage",
    2: "overheating",
    3: "motor encoder",
    4: "electrical shock",
    5: "overload",
}
"""Meaning of the bits of the hardware error status (address 70)."""

MODEL_NUMBER, OPERATING_MODE, CURRENT_LIMIT = 0, 11, 38
TORQUE_ENABLE, BUS_WATCHDOG, GOAL_CURRENT, GOAL_VELOCITY, GOAL_POSITION = 64, 98, 102, 104, 116
MOTION = (126, 10)
"""Address and length of the present current, velocity and position."""
CONDITION = (64, 35)
"""Address and length of the data from the torque enable (64) to the bus watchdog (98)."""
WATCHDOG_UNIT = 20e-3
"""Time of one unit of the bus watchdog [s]."""
POSITION_UNIT = 1.0 / 4096.0
"""Turns of one unit of the position."""
VELOCITY_UNIT = 0.229 / 60.0
"""Turns per second of one unit of the velocity."""
LONGEST = 256


class Model(NamedTuple):
    """A model of the X series."""

    number: int
    """Value at the address 0."""
    current: float
    """Unit of the current [A]."""


MODELS = {
    "XL330-M077": Model(1190, 1e-3),
    "XL330-M288": Model(1200, 1e-3),
    "XC330-M288": Model(1240, 1e-3),
    "XM430-W350": Model(1020, 2.69e-3),
    "XM540-W270": Model(1120, 2.69e-3),
}
"""Models with current control."""


class Motion(NamedTuple):
    """Present values of a servo, in its units."""

    current: int
    velocity: int
    position: int


class Condition(NamedTuple):
    """Condition of a servo."""

    torque: bool
    """Whether its torque is switched on."""
    hardware: int
    """Hardware error status."""
    watchdog: int
    """Bus watchdog; -1 if it has expired."""


def crc_step(byte: int) -> int:
    """Return the CRC of one byte for the initial value 0."""
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1 ^ 0x8005 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


CRC_STEPS = tuple(crc_step(byte) for byte in range(256))


def crc16(data: bytes) -> int:
    """Return the CRC-16 of a packet, with the polynomial 0x8005 and the initial value 0."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ CRC_STEPS[crc >> 8 ^ byte]
    return crc


def packet(identifier: int, instruction: int, parameters: bytes) -> bytes:
    """Return the bytes of a packet."""
    body = bytes((instruction,)) + parameters
    body = body.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
    head = HEADER + struct.pack("<BH", identifier, len(body) + 2) + body
    return head + struct.pack("<H", crc16(head))


def read(identifier: int, address: int, length: int) -> bytes:
    """Return the request for the data at an address."""
    return packet(identifier, READ, struct.pack("<HH", address, length))


def write(identifier: int, address: int, data: bytes) -> bytes:
    """Return the request to write data at an address; the servo answers."""
    return packet(identifier, WRITE, struct.pack("<H", address) + data)


def silent_write(identifier: int, address: int, data: bytes) -> bytes:
    """Return the request to write data at an address, without an answer (Sync Write)."""
    parameters = struct.pack("<HHB", address, len(data), identifier) + data
    return packet(BROADCAST, SYNC_WRITE, parameters)


class Found(NamedTuple):
    """Packets that were found in a stream of bytes."""

    packets: list[tuple[int, bytes]]
    """Identifier, and instruction with parameters, of each packet."""
    rejected: Counter[str]
    rest: bytes


def find(data: bytes) -> Found:
    """Find the packets in the bytes of a line. Bytes before a packet are dropped."""
    packets: list[tuple[int, bytes]] = []
    rejected: Counter[str] = Counter()
    while True:
        start = data.find(HEADER)
        if start < 0:
            return Found(packets, rejected, data[-3:])
        data = data[start:]
        if len(data) < 7:
            return Found(packets, rejected, data)
        size = 7 + int.from_bytes(data[5:7], "little")
        if not 10 <= size <= LONGEST:
            rejected["length"] += 1
            data = data[4:]
            continue
        if len(data) < size:
            return Found(packets, rejected, data)
        if crc16(data[: size - 2]) != int.from_bytes(data[size - 2 : size], "little"):
            rejected["checksum"] += 1
            data = data[4:]
            continue
        body = data[7 : size - 2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
        packets.append((data[4], body))
        data = data[size:]


def motion(data: bytes) -> Motion:
    """Return the present values in the data of `MOTION`."""
    return Motion(*struct.unpack("<hii", data))


def condition(data: bytes) -> Condition:
    """Return the condition in the data of `CONDITION`."""
    return Condition(bool(data[0]), data[6], struct.unpack_from("<b", data, 34)[0])
