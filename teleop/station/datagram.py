"""The datagram that a station sends to the other one at each tick, and its signature.

All datagrams have the same size. Integers and doubles are little-endian:

=============  =====================================================================================
bytes          content
=============  =====================================================================================
0 to 1         the letters TS
2              version of this format
3              kind, always `TICK`
4              mode of the supervisor of the sender
5              flags
6              rank of the first fault of the sender; 255 without a fault
7              0
8 to 15        session
16 to 23       sequence number, from 0
24 to 31       time at which the datagram was sent, on the clock of the sender [s]
32 to 39       bound of the clock offset: smallest receive time minus send time that the sender has
               found in the datagrams that it received [s]
40 to 47       echo: time in the newest datagram of the other station that the sender uses [s]
48 to 111      eight values: `MasterMotion` or `Report`
112 to 127     signature: keyed BLAKE2s of the bytes before
=============  =====================================================================================
"""

from __future__ import annotations

import struct
from hashlib import blake2s
from hmac import compare_digest
from typing import NamedTuple

from drivers import new_tuple
from teleop.control.admittance import Environment
from teleop.control.feedback.law import PRIOR, MasterMotion, Report
from teleop.safety import Mode

MAGIC = b"TS"
VERSION = 1
HELLO, WELCOME, TICK = 1, 2, 3
"""Kinds of datagrams: the two of the handshake, and the datagram of a tick."""
SIGNATURE = 16
"""Size of a signature [bytes]."""
VALUES = 8
"""Number of values in a datagram of a tick."""
LAYOUT = struct.Struct(f"<2sBBBBBxQQddd{VALUES}d")
SIZE = LAYOUT.size + SIGNATURE
"""Size of a datagram of a tick [bytes]."""
SESSION = slice(8, 16)
"""Bytes of the session in a datagram of a tick."""
CONSENT, ENDING = 1, 2
"""Flags: a person at the sender has permitted the drives to move; the run of the sender ends."""
NO_FAULT = 255
MODES = tuple(Mode)
PADDING = {3: (0.0,) * 5, 7: (0.0,)}


class Datagram(NamedTuple):
    """Content of a datagram of a tick."""

    mode: Mode
    """Mode of the supervisor of the sender."""
    flags: int
    """Sum of `CONSENT` and `ENDING`."""
    fault: int
    """Rank of the first fault of the sender (`teleop.safety.events.SEVERITY`), or `NO_FAULT`."""
    session: int
    sequence: int
    """Number of the datagram, from 0; a sender uses each number once in a session."""
    sent: float
    """Time at which the datagram was sent, on the clock of the sender [s]."""
    bound: float
    """Smallest receive time minus send time of the datagrams that the sender received [s];
    infinite before the first one."""
    echo: float
    """Time at which the receiver of this datagram sent the data that the sender uses [s]; NaN
    before the first one."""
    values: tuple[float, ...]
    """Values of a `MasterMotion` or of a `Report`."""


def sign(data: bytes, key: bytes) -> bytes:
    """Return the signature of some bytes."""
    return blake2s(data, digest_size=SIGNATURE, key=key).digest()


def is_signed(data: bytes, key: bytes) -> bool:
    """Return whether the last bytes of a datagram are the signature of the bytes before."""
    return compare_digest(sign(data[:-SIGNATURE], key), data[-SIGNATURE:])


def pack(datagram: Datagram, key: bytes) -> bytes:
    """Return the signed bytes of a datagram of a tick."""
    mode, flags, fault, session, sequence, sent, bound, echo, values = datagram
    body = LAYOUT.pack(
        MAGIC,
        VERSION,
        TICK,
        mode,
        flags,
        fault,
        session,
        sequence,
        sent,
        bound,
        echo,
        *values,
        *PADDING[len(values)],
    )
    return body + sign(body, key)


def unpack(data: bytes) -> Datagram | None:
    """Return the content of a datagram of a tick; None if the bytes are no such datagram.

    The signature is not checked.
    """
    if len(data) != SIZE:
        return None
    magic, version, kind, mode, *head, sent, bound, echo = LAYOUT.unpack_from(data)[:-VALUES]
    if magic != MAGIC or version != VERSION or kind != TICK or mode >= len(MODES):
        return None
    values = LAYOUT.unpack_from(data)[-VALUES:]
    return new_tuple(Datagram, (MODES[mode], *head, sent, bound, echo, values))


def motion_values(motion: MasterMotion) -> tuple[float, ...]:
    """Return the values of the motion of the master in a datagram."""
    return tuple(motion)


def to_motion(values: tuple[float, ...]) -> MasterMotion:
    """Return the motion of the master that is in a datagram."""
    return new_tuple(MasterMotion, values[:3])


def report_values(report: Report) -> tuple[float, ...]:
    """Return the values of the report of the slave in a datagram."""
    force, (k, k3, b, glued), energy, tip = report
    return force, k, k3, b, float(glued), energy, tip


def to_report(values: tuple[float, ...], model: Environment = PRIOR) -> Report:
    """Return the report of the slave that is in a datagram.

    `model` is that of the report before. If it is equal, the result has the same object, by which
    the master recognises a model that it displays already.
    """
    force, k, k3, b, glued, energy, tip, _ = values
    received = k, k3, b, glued != 0.0
    if received != model:
        model = new_tuple(Environment, received)
    return new_tuple(Report, (force, model, energy, tip))
