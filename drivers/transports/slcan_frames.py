"""Convert CAN frames to lines of text of the slcan protocol, and lines to frames."""

from __future__ import annotations

from binascii import hexlify, unhexlify

import can


def encode(msg: can.Message) -> bytes:
    """Return a CAN frame as a line of the slcan protocol, with the CR at the end."""
    length = 0 if msg.is_remote_frame else msg.dlc
    limit = 1 << 29 if msg.is_extended_id else 1 << 11
    if (
        msg.is_fd
        or msg.is_error_frame
        or msg.dlc > 8
        or len(msg.data) != length
        or not 0 <= msg.arbitration_id < limit
    ):
        raise ValueError(f"slcan frame {msg!r}: expected a classical data or remote frame")
    kind = "r" if msg.is_remote_frame else "t"
    if msg.is_extended_id:
        head = f"{kind.upper()}{msg.arbitration_id:08X}{msg.dlc}"
    else:
        head = f"{kind}{msg.arbitration_id:03X}{msg.dlc}"
    return head.encode() + hexlify(msg.data).upper() + b"\r"


def decode(line: bytes, timestamp: float) -> can.Message:
    """Return the CAN frame that a line of the slcan protocol contains."""
    extended, remote = line[:1] in b"TR", line[:1] in b"rR"
    place = 9 if extended else 4
    identifier = int.from_bytes(unhexlify(line[1:9] if extended else b"0" + line[1:4]), "big")
    length = b"012345678".index(line[place : place + 1])
    stop = place + 1 + (0 if remote else 2 * length)
    if len(line) not in (stop, stop + 4) or identifier >= 1 << (29 if extended else 11):
        raise ValueError("invalid frame")
    data = unhexlify(line[place + 1 :])
    return can.Message(
        timestamp=timestamp,
        arbitration_id=identifier,
        is_extended_id=extended,
        is_remote_frame=remote,
        dlc=length,
        data=data[:length],
    )
