"""Send and receive CAN frames with the buses that python-can opens."""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence
from typing import Any, Protocol

from drivers.rig import new_tuple
from drivers.transports.can_frame import CanFrame

MOST = 4096
"""Largest number of frames that one reading of the bus returns."""
EXTENDED, REMOTE, ERROR = 1 << 31, 1 << 30, 1 << 29
"""Flags in the identifier of a frame of Linux (`linux/can.h`). DBC files have the first one too."""
HEADER = struct.Struct("=IBB2x")
"""Identifier with flags, number of data bytes, and flags of CAN FD, before the data of a frame."""
CLASSICAL_SIZE, FD_SIZE = 16, 72
"""Sizes of a frame of Linux [bytes]."""
BITRATE_SWITCH, FD_FRAME = 1, 4
"""Flags of CAN FD."""
TIMESPEC = struct.Struct("@ll")
CONTROL = socket.CMSG_SPACE(TIMESPEC.size) if hasattr(socket, "CMSG_SPACE") else 0
"""Size of the buffer for the time stamp of a frame [bytes]."""


class CanAdapter(Protocol):
    """What `CanBus` uses of an open adapter. Errors are `can.CanError` or `OSError`."""

    def drain(self) -> list[CanFrame]:
        """Return the frames that have arrived, without waiting."""

    def put(self, frames: Sequence[CanFrame]) -> None:
        """Send frames, without waiting."""

    def shutdown(self) -> None:
        """Close the adapter."""


class PythonCanAdapter:
    """An adapter that python-can accesses."""

    def __init__(self, bus: Any) -> None:
        self.bus = bus

    def drain(self) -> list[CanFrame]:
        """Return the frames that have arrived, at most 4096, without waiting."""
        frames: list[CanFrame] = []
        while len(frames) < MOST and (message := self.bus.recv(0)) is not None:
            frames.append(CanFrame.of(message))
        return frames

    def put(self, frames: Sequence[CanFrame]) -> None:
        """Send frames, without waiting."""
        for frame in frames:
            self.bus.send(frame.message())

    def shutdown(self) -> None:
        """Close the adapter."""
        self.bus.shutdown()


class SocketCanAdapter(PythonCanAdapter):
    """SocketCAN of Linux: the socket of python-can, with one system call per frame.

    The time stamps are those of the kernel, as python-can requests them.
    """

    def drain(self) -> list[CanFrame]:
        """Return the frames that have arrived, at most 4096, without waiting."""
        receive = self.bus.socket.recvmsg
        frames: list[CanFrame] = []
        try:
            while len(frames) < MOST:
                data, control, _, _ = receive(FD_SIZE, CONTROL, socket.MSG_DONTWAIT)
                frames.append(unpacked(data, stamp_of(control)))
        except BlockingIOError:
            pass
        return frames

    def put(self, frames: Sequence[CanFrame]) -> None:
        """Send frames, without waiting. OSError: the queue is full, or the interface is down."""
        send = self.bus.socket.send
        for frame in frames:
            send(packed(frame), socket.MSG_DONTWAIT)


def unpacked(data: bytes, timestamp: float) -> CanFrame:
    """Return the frame in the bytes that a socket of Linux has received."""
    identifier, length, flags = HEADER.unpack_from(data)
    is_fd = len(data) == FD_SIZE
    extended, remote = bool(identifier & EXTENDED), bool(identifier & REMOTE)
    values = (
        identifier & (0x1FFFFFFF if extended else 0x7FF),
        b"" if remote else data[HEADER.size : HEADER.size + length],
        timestamp,
        extended,
        remote,
        bool(identifier & ERROR),
        is_fd,
        is_fd and bool(flags & BITRATE_SWITCH),
        length if remote else 0,
    )
    return new_tuple(CanFrame, values)


def packed(frame: CanFrame) -> bytes:
    """Return the bytes with which a socket of Linux sends a frame."""
    identifier = (
        frame.arbitration_id
        | frame.is_extended_id * EXTENDED
        | frame.is_remote_frame * REMOTE
        | frame.is_error_frame * ERROR
    )
    flags = frame.is_fd * FD_FRAME | frame.bitrate_switch * BITRATE_SWITCH
    size = FD_SIZE if frame.is_fd else CLASSICAL_SIZE
    return (HEADER.pack(identifier, frame.dlc, flags) + frame.data).ljust(size, b"\0")


def stamp_of(control: Sequence[tuple[int, int, bytes]]) -> float:
    """Return the time stamp of the kernel [s]; 0 if there is none."""
    if not control:
        return 0.0
    seconds, nanoseconds = TIMESPEC.unpack_from(control[0][2])
    return float(seconds + 1e-9 * nanoseconds)
