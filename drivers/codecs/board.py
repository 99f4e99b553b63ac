"""Encode and decode messages of the serial protocol for boards (docs/serial-protocol.md).

A board is a microcontroller board to which sensors and drives are connected. Forces, positions,
velocities and analogue values are sent as integers, called counts. For each signal, the
configuration file of the rig contains the scale: the force, displacement, velocity or voltage of
one count.
"""

from __future__ import annotations

import struct
from collections import Counter
from enum import IntEnum
from typing import NamedTuple

from drivers.framing import cobs
from drivers.framing.crc import crc16_x25, ends_with_x25
from drivers.rig import new_tuple

VERSION, FORCE_VERSION = 1, 2
"""Versions of the protocol: of a board whose axes all accept velocities, and of another one."""
FORCES = 2
"""Number of force inputs in the messages."""
AXES = 2
"""Number of axes in the messages. The number of encoders is the same."""
ANALOGUES = 4
"""Number of analogue inputs in the messages."""

HELLO, CONFIGURE, ENABLE, COMMAND, DISABLE = range(0x01, 0x06)
"""Types of the messages from the host."""
IDENTITY, CONFIGURED, SAMPLE = range(0x81, 0x84)
"""Types of the messages from the board."""

LONGEST = 64
"""Largest length of an encoded frame without its delimiter [bytes]."""
GREATEST = (1 << 31) - 1
"""Largest magnitude of a value [counts]."""
HEAD = struct.Struct("<BH")
"""Layout of the first bytes of each message: type and sequence number."""
CHECKSUM = struct.Struct("<H")
SETTINGS = struct.Struct("<HH")
AXIS_MASK = struct.Struct("<B")
COMMANDS = struct.Struct(f"<{AXES}i")
UNUSED = AXES * (0,)
"""Values of the axes that a board does not have, in a COMMAND message."""
STAMP = struct.Struct("<IB")
IDENTITY_FRAME = struct.Struct("<BHIB2BI4B")
FORCE_IDENTITY_FRAME = struct.Struct("<BHIB2BI5B")
CONFIGURED_FRAME = struct.Struct("<BHIHH")
SAMPLE_FRAME = struct.Struct(f"<xHIBBBHH{FORCES + 2 * AXES + ANALOGUES}i")


class BoardState(IntEnum):
    """State of the board, which is part of each sample.

    The board leaves the states WATCHDOG, EMERGENCY_STOP and DRIVE_FAULT only when it receives the
    message DISABLE, HELLO or CONFIGURE.
    """

    IDLE = 0
    ENABLED = 1
    WATCHDOG = 2
    """No command was received within the watchdog time."""
    EMERGENCY_STOP = 3
    DRIVE_FAULT = 4


class Input(IntEnum):
    """Digital inputs of the board. Each value is the bit of one input in `Sample.inputs`."""

    EMERGENCY_STOP = 1
    """This bit is set if the emergency-stop circuit is open."""
    DRIVE_FAULT = 2
    """This bit is set if a drive reports a fault."""


class Identity(NamedTuple):
    """Message with the properties of the board. It is the answer to a HELLO message.

    If the board uses an unknown version of the protocol, only the fields `sequence`, `time` and
    `version` are read from the message. The other fields then have their default values.
    """

    sequence: int
    time: int
    """Time of the answer on the board's clock [us]."""
    version: int
    """Version of the protocol."""
    firmware: tuple[int, int] = (0, 0)
    boot: int = 0
    """Number that is different after each start of the board."""
    forces: int = 0
    encoders: int = 0
    axes: int = 0
    analogues: int = 0
    force_axes: int = 0
    """Bit mask of the axes that accept forces."""


class Configured(NamedTuple):
    """Answer of the board to a CONFIGURE message, with the settings that the board uses."""

    sequence: int
    time: int
    """Time of the answer on the board's clock [us]."""
    watchdog: int
    """Watchdog time [ms]."""
    sample_rate: int
    """Sample rate [Hz]."""


class Sample(NamedTuple):
    """Measurements of the board, all taken at the same time, and the state of the board."""

    sequence: int
    time: int
    """Time of the measurements on the board's clock [us]."""
    state: int
    """One of `BoardState`."""
    axes: int
    """Bit mask of the enabled axes."""
    inputs: int
    """Bit mask of `Input`."""
    acknowledged: int
    """Sequence number of the last frame that the board accepted."""
    rejected: int
    """Number of frames that the board has rejected since HELLO, modulo 2^16."""
    counts: tuple[int, ...]
    """Counts of the forces, positions, velocities and analogue inputs, in this order."""


Message = Identity | Configured | Sample


def frame(kind: int, sequence: int, payload: bytes = b"") -> bytes:
    """Return the bytes of a message as sent on the serial line.

    The message and its checksum are encoded by COBS. The last byte is the delimiter, a zero byte.
    """
    body = HEAD.pack(kind, sequence) + payload
    return cobs.encode(body + CHECKSUM.pack(crc16_x25(body))) + cobs.DELIMITER


def configure(watchdog: int, sample_rate: int) -> bytes:
    """Return the payload of a CONFIGURE message: watchdog time [ms] and sample rate [Hz]."""
    return SETTINGS.pack(watchdog, sample_rate)


def enable(axis: int) -> bytes:
    """Return the payload of an ENABLE message, which enables the axis with the index `axis`."""
    return AXIS_MASK.pack(1 << axis)


def command(*values: int) -> bytes:
    """Return the payload of a COMMAND message, which sets the velocities or forces of the axes.

    Each argument is the velocity or force of one axis, in counts of this axis (`to_counts`). The
    axes without an argument get the value 0.
    """
    return COMMANDS.pack(*values, *UNUSED[len(values) :])


def to_counts(value: float, scale: float) -> int:
    """Return a value in counts, which are the integers in the messages of the board.

    The result is `value / scale`, rounded and limited to +-`GREATEST`.
    """
    return round(min(max(value / scale, -GREATEST), GREATEST))


def decode(body: bytes) -> Message | None:
    """Return the message that a frame contains.

    The result is None if the type of the message is unknown, or if its length is wrong.
    """
    kind, length = body[0], len(body)
    if kind == SAMPLE and length == SAMPLE_FRAME.size:
        values = SAMPLE_FRAME.unpack(body)
        return new_tuple(Sample, (*values[:7], values[7:]))
    if kind == CONFIGURED and length == CONFIGURED_FRAME.size:
        return Configured(*CONFIGURED_FRAME.unpack(body)[1:])
    if kind == IDENTITY and length >= HEAD.size + STAMP.size:
        sequence = HEAD.unpack_from(body)[1]
        time, version = STAMP.unpack_from(body, HEAD.size)
        if version not in (VERSION, FORCE_VERSION):
            return Identity(sequence, time, version)
        layout = IDENTITY_FRAME if version == VERSION else FORCE_IDENTITY_FRAME
        if length == layout.size:
            major, minor, boot, *numbers = layout.unpack(body)[4:]
            return Identity(sequence, time, version, (major, minor), boot, *numbers)
    return None


class MessageReader:
    """Finds and decodes the messages of a board in a stream of bytes."""

    def __init__(self, rejected: Counter[str] | None = None) -> None:
        self.rejected: Counter[str] = Counter() if rejected is None else rejected
        self._frames = cobs.CobsReader(LONGEST, self.rejected)

    def feed(self, data: bytes) -> list[Message]:
        """Process the next bytes of the stream, and return the messages that they complete."""
        messages: list[Message] = []
        for body in self._frames.feed(data):
            if len(body) < HEAD.size + CHECKSUM.size:
                self.rejected["length"] += 1
            elif not ends_with_x25(body):
                self.rejected["checksum"] += 1
            elif message := decode(body[:-2]):
                messages.append(message)
            else:
                self.rejected["message"] += 1
        return messages
