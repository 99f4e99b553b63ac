"""The other station of a session: what it sent, how it arrived, and what is sent to it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from teleop.safety import Mode
from teleop.station.clock_offset import UNKNOWN, Interval, OffsetBound, offset_interval
from teleop.station.datagram import (
    NO_FAULT,
    SESSION,
    SIZE,
    Datagram,
    is_signed,
    pack,
    unpack,
)
from teleop.station.keys import Session
from teleop.station.sequence_window import NEWEST, REPEATED, SequenceWindow
from teleop.station.station_port import Received, StationPort

MOST = 128
"""Largest number of datagrams that are read in a tick, whatever arrives."""
TRACKING = 200e-6
"""Rate at which `transit` follows the bound of the clock offset [s/s], faster than the clocks
drift."""


class Peer:
    """The other station, with which this station exchanges datagrams in a session.

    `place` is the address to which datagrams are sent, and `now` returns the time on the clock of
    this station [s]. `first` datagrams were sent before.
    """

    def __init__(
        self,
        port: StationPort,
        place: tuple[Any, ...],
        session: Session,
        now: Callable[[], float],
        first: int = 0,
    ) -> None:
        self.port = port
        self.now = now
        self._place, self._session = place, session
        self._number = session.number.to_bytes(8, "little")
        self._bound = OffsetBound()
        self.window = SequenceWindow()
        self.newest: Datagram | None = None
        """Newest datagram that was accepted."""
        self.heard = -math.inf
        """Time at which the newest datagram arrived [s]."""
        self.sent = first
        """Number of datagrams that were sent."""
        self.overtaken = 0
        """Number of datagrams that arrived after a newer one. They are not used."""
        self.rejected: dict[str, int] = {}
        """Number of rejected datagrams for each reason: size, session, signature, repeated."""
        self.transit = math.nan
        """Smallest receive time minus send time of recent datagrams, which changes slowly [s]."""
        self._updated = 0.0

    @property
    def mode(self) -> Mode:
        """Mode of the supervisor of the other station, in its newest datagram."""
        return self.newest.mode if self.newest else Mode.DISCONNECTED

    def receive(self) -> None:
        """Read what has arrived. The control loop calls this method at the start of each tick."""
        received = self.port.receive(MOST)
        now = self.now()
        for one in received:
            if problem := self._add(now, one):
                self.rejected[problem] = self.rejected.get(problem, 0) + 1
        bound, before, self._updated = self._bound.at(now), self._updated, now
        if not self.transit < math.inf:
            self.transit = bound
        elif bound < math.inf:
            most = TRACKING * (now - before)
            self.transit += min(max(bound - self.transit, -most), most)

    def settle(self) -> None:
        """Set `transit` to the present bound of the clock offset, before the drives move."""
        self.transit = self._bound.at(self.now())

    def _add(self, now: float, received: Received) -> str:
        """Accept a datagram, or return why it is rejected."""
        data = received.data
        if len(data) != SIZE:
            return "size"
        if data[SESSION] != self._number:
            return "session"
        if not is_signed(data, self._session.receive_key):
            return "signature"
        datagram = unpack(data)
        if not datagram:
            return "version"
        arrival = self.window.add(datagram.sequence)
        if arrival is REPEATED:
            return "repeated"
        arrived = now - received.age
        self._bound.add(now, arrived - datagram.sent)
        if arrival is NEWEST:
            self.newest, self.heard = datagram, arrived
        else:
            self.overtaken += 1
        return ""

    def send(
        self,
        mode: Mode,
        flags: int,
        values: tuple[float, ...],
        echo: float = math.nan,
        fault: int = NO_FAULT,
    ) -> None:
        """Send a datagram. The control loop calls this method at the end of each tick."""
        number, sent = self.sent, self.now()
        self.sent += 1
        bound = self._bound.at(sent)
        datagram = (mode, flags, fault, self._session.number, number, sent, bound, echo, values)
        self.port.send(pack(Datagram._make(datagram), self._session.send_key), self._place)

    def offset(self) -> Interval:
        """Return the interval of the time here minus the time at the other station [s]."""
        newest = self.newest
        if not newest:
            return UNKNOWN
        now = self.now()
        own = self._bound.at(now)
        since = now - newest.sent + newest.bound  # at most this long ago, whatever the offset is
        return offset_interval(own, newest.bound, since)

    def age(self, sent: float) -> Interval:
        """Return the interval of the time since the other station's time `sent` [s]."""
        offset, since = self.offset(), self.now() - sent
        return Interval(max(since - offset.high, 0.0), since - offset.low)
