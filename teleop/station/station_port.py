"""UDP port of a station, which reads a bounded number of datagrams and never waits.

Linux notes the time at which it received each datagram (`SO_TIMESTAMPNS`). Without this time, the
datagram seems to arrive only when the tick reads it, up to one period later. The note is a time of
the clock of the day, which may be set at any moment. It is used only while this clock and the
monotonic clock advance equally.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import sys
import time
from typing import Any, NamedTuple, Self

from teleop.errors import InputError, reason
from teleop.station.address import Address

LARGEST = 2048
"""Largest number of bytes that are read of a datagram."""
SO_TIMESTAMPNS = 35
"""Option of a socket on Linux (`asm-generic/socket.h`), which Python does not name."""
STAMP = struct.Struct("qq")
MOST_STEP = 50_000
"""Largest difference of the advance of both clocks between two reads [ns]."""
OLDEST = 1_000_000_000
"""Greatest age of a datagram in the queue of the operating system [ns]. A greater one is wrong."""
QUEUE = 1 << 16
"""Size of the queue of received datagrams [bytes]: if too many arrive, old ones do not wait."""


class Received(NamedTuple):
    """A datagram that was read."""

    data: bytes
    place: tuple[Any, ...]
    """Address of the sender."""
    age: float
    """Time since the operating system received the datagram [s]."""


class StationPort:
    """UDP port of a station.

    A station that `listens` has the stated address, and another one sends to this address from any
    free port.
    """

    def __init__(self, address: Address, listens: bool) -> None:
        self.address = address
        self.unsent = 0
        """Number of datagrams that the operating system refused to send."""
        self._socket = socket.socket(address.family, socket.SOCK_DGRAM)
        self._stamped = False
        self._apart = 0
        try:
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, QUEUE)
            if sys.platform == "linux":
                self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
                self._stamped = True
            if listens:
                self._socket.bind(address.place)
        except OSError as error:
            self._socket.close()
            raise InputError(
                f"address {address.text}: {reason(error)}: expected a free port of this computer"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def fileno(self) -> int:
        """Return the descriptor of the socket, to wait for datagrams."""
        return self._socket.fileno()

    @property
    def place(self) -> tuple[Any, ...]:
        """Address of this port."""
        place: tuple[Any, ...] = self._socket.getsockname()
        return place

    def send(self, data: bytes, place: tuple[Any, ...]) -> None:
        """Send a datagram. If the operating system refuses it, it is counted as not sent."""
        try:
            self._socket.sendto(data, place)
        except OSError:  # the network is down, or its queue is full
            self.unsent += 1

    def receive(self, most: int) -> list[Received]:
        """Return the datagrams that have arrived, at most `most`."""
        found = []
        real, steady = time.time_ns(), time.monotonic_ns()
        apart, self._apart = self._apart, real - steady
        stamped = self._stamped and abs(apart - self._apart) < MOST_STEP
        with contextlib.suppress(BlockingIOError, ConnectionError):
            for _ in range(most):
                data, notes, _, place = self._socket.recvmsg(LARGEST, 64)
                age = 0
                if stamped and notes:
                    seconds, rest = STAMP.unpack_from(notes[0][2])
                    age = real - (seconds * 1_000_000_000 + rest)
                    # one that arrived during this loop has a negative age
                    age = age if 0 <= age <= OLDEST else 0
                found.append(Received(data, place, age * 1e-9))
        return found
