"""Messages of the serial protocol for microcontroller boards (docs/serial-protocol.md).

Readings are counts of the board's converters and encoders; what a count is stands in the rig file.
"""

from __future__ import annotations

import struct
from collections import Counter
from enum import IntEnum
from typing import NamedTuple

from drivers.framing import cobs
from drivers.framing.crc import crc16_x25

VERSION = 1
"""Of the protocol."""
FORCES = 2
AXES = 2
ANALOGUES = 4

HELLO, CONFIGURE, ENABLE, COMMAND, DISABLE = range(0x01, 0x06)
"""Types of the host's messages."""
IDENTITY, CONFIGURED, SAMPLE = range(0x81, 0x84)
"""Types of the board's messages."""

LONGEST = 64
"""Most bytes of an encoded frame."""
GREATEST = (1 << 31) - 1
HEAD = struct.Struct("<BH")
CHECKSUM = struct.Struct("<H")
SETTINGS = struct.Struct("<HH")
AXIS_MASK = struct.Struct("<B")
VELOCITIES = struct.Struct(f"<{AXES}i")
STAMP = struct.Struct("<IB")
IDENTITY_FRAME = struct.Struct("<BHIB2BI4B")
CONFIGURED_FRAME = struct.Struct("<BHIHH")
SAMPLE_FRAME = struct.Struct(f"<BHIBBBHH{FORCES + 2 * AXES + ANALOGUES}i")


class State(IntEnum):
    """What the board does; all but the first two are latched until it is disabled."""

    IDLE = 0
    ENABLED = 1
    WATCHDOG = 2
    """No command came in time."""
    EMERGENCY_STOP = 3
    DRIVE_FAULT = 4


class Input(IntEnum):
    """Bits of the digital inputs."""

    EMERGENCY_STOP = 1
    DRIVE_FAULT = 2


class Identity(NamedTuple):
    """The board's answer to HELLO; of another version of the protocol, no more than which."""

    sequence: int
    time: int
    """The board's clock [us]."""
    version: int
    firmware: tuple[int, int] = (0, 0)
    boot: int = 0
    """Different after each start of the board."""
    forces: int = 0
    encoders: int = 0
    axes: int = 0
    analogues: int = 0


class Configured(NamedTuple):
    """The board's answer to CONFIGURE: what holds now."""

    sequence: int
    time: int
    watchdog: int
    """[ms]"""
    sample_rate: int
    """[Hz]"""


class Sample(NamedTuple):
    """What the board reads at one instant, and how it is."""

    sequence: int
    time: int
    """The board's clock [us]."""
    state: int
    axes: int
    """Bit mask of the axes that are enabled."""
    inputs: int
    acknowledged: int
    """Sequence number of the last frame that the board took."""
    rejected: int
    """Frames that it did not take since HELLO, modulo 2^16."""
    counts: tuple[int, ...]
    """Of the forces, positions, velocities and analogue inputs, in this order."""


Message = Identity | Configured | Sample


def frame(kind: int, sequence: int, payload: bytes = b"") -> bytes:
    """A message on the wire, with its delimiter."""
    body = HEAD.pack(kind, sequence) + payload
    return cobs.encode(body + CHECKSUM.pack(crc16_x25(body))) + cobs.DELIMITER


def configure(watchdog: int, sample_rate: int) -> bytes:
    """Payload of CONFIGURE: watchdog [ms] and samples a second [Hz]."""
    return SETTINGS.pack(watchdog, sample_rate)


def enable(axis: int) -> bytes:
    """Payload of ENABLE for one axis."""
    return AXIS_MASK.pack(1 << axis)


def command(*velocities: int) -> bytes:
    """Payload of COMMAND: a velocity for each axis [counts]."""
    return VELOCITIES.pack(*velocities)


def to_counts(value: float, scale: float) -> int:
    """A value in counts of a scale, the nearest that the protocol can say."""
    return round(min(max(value / scale, -GREATEST), GREATEST))


def decode(body: bytes) -> Message | None:
    """The message of a frame whose check sum is right; None if it is none of the board's."""
    kind, length = body[0], len(body)
    if kind == SAMPLE and length == SAMPLE_FRAME.size:
        _, sequence, time, state, axes, inputs, acknowledged, rejected, *counts = (
            SAMPLE_FRAME.unpack(body)
        )
        return Sample(sequence, time, state, axes, inputs, acknowledged, rejected, tuple(counts))
    if kind == CONFIGURED and length == CONFIGURED_FRAME.size:
        return Configured(*CONFIGURED_FRAME.unpack(body)[1:])
    if kind == IDENTITY and length >= HEAD.size + STAMP.size:
        sequence = HEAD.unpack_from(body)[1]
        time, version = STAMP.unpack_from(body, HEAD.size)
        if version != VERSION:
            return Identity(sequence, time, version)
        if length == IDENTITY_FRAME.size:
            *_, major, minor, boot, forces, encoders, axes, analogues = IDENTITY_FRAME.unpack(body)
            firmware = (major, minor)
            return Identity(
                sequence, time, version, firmware, boot, forces, encoders, axes, analogues
            )
    return None


class MessageReader:
    """Takes the board's messages out of a stream.

    Parameters
    ----------
    rejected
        Where frames that are not taken are counted: as `length`, `framing`, `checksum` or
        `message`.
    """

    def __init__(self, rejected: Counter[str] | None = None) -> None:
        self.rejected: Counter[str] = Counter() if rejected is None else rejected
        self._frames = cobs.CobsReader(LONGEST, self.rejected)

    def feed(self, data: bytes) -> list[Message]:
        """The messages that are complete with these bytes."""
        messages: list[Message] = []
        for body in self._frames.feed(data):
            if len(body) < HEAD.size + CHECKSUM.size:
                self.rejected["length"] += 1
            elif crc16_x25(body[:-2]) != CHECKSUM.unpack_from(body, len(body) - 2)[0]:
                self.rejected["checksum"] += 1
            elif message := decode(body[:-2]):
                messages.append(message)
            else:
                self.rejected["message"] += 1
        return messages
