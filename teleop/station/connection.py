"""Wait for the other station, and begin a session with it. Nothing moves in this time."""

from __future__ import annotations

import math
import select
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from teleop.control.clock import Clock
from teleop.errors import InputError
from teleop.names import SideName
from teleop.safety import Mode
from teleop.station.address import text_of
from teleop.station.agreement import common_round_trip
from teleop.station.datagram import NO_FAULT, Datagram, pack
from teleop.station.handshake import Document, MasterHandshake, SlaveHandshake, differences
from teleop.station.keys import Session
from teleop.station.peer import MOST, Peer
from teleop.station.station import Station
from teleop.station.station_port import StationPort

PAUSE = 0.05
"""Time between two datagrams of the handshake [s]."""
CONFIRMATIONS = 3
"""Number of datagrams with which the master confirms a session. If all are lost, the datagrams of
its ticks confirm it."""
CONNECTING = 30.0
"""Longest time for which the master waits for an answer [s]."""

Show = Callable[[str], None]
"""Shows one line of text to the person."""


class Connection(NamedTuple):
    """A session that both stations have begun, before the control loop."""

    port: StationPort
    place: tuple[Any, ...]
    """Address of the other station."""
    session: Session
    side: SideName
    """Side of this station."""
    longest: float
    """Longest round trip that both stations permit [s]."""
    others: Document
    """What the other station has stated of itself."""

    @property
    def text(self) -> str:
        """One line that describes the other station."""
        return f"{self.others['rig']} at {text_of(self.place)}"

    def begin(self, clock: Clock) -> Station:
        """Return the station for a control loop with this clock."""
        first = CONFIRMATIONS if self.side == "master" else 0
        peer = Peer(self.port, self.place, self.session, clock.now, first)
        return Station(self.side, peer, self.longest)


def connect(port: StationPort, key: bytes, own: Document, show: Show) -> Connection:
    """Begin a session with the slave station at the address of the port; return it."""
    handshake, place = MasterHandshake(key, own), port.address.place
    show(f"asks {port.address.text} for a session; Ctrl-C ends")
    end = time.monotonic() + CONNECTING
    while time.monotonic() < end:
        port.send(handshake.hello, place)
        select.select([port], [], [], PAUSE)
        for received in port.receive(MOST):
            session = handshake.receive(received.data)
            if session:
                others = handshake.settings
                if different := different_settings(own, others):
                    raise InputError(different)
                confirm(port, place, session)
                longest = common_round_trip(own, others)
                return Connection(port, place, session, "master", longest, others)
    raise InputError(
        f"no answer from {port.address.text} within {CONNECTING:g} s: expected a station that "
        "waits there (teleop station slave), with the same key file. A station accepts one session "
        "per run"
    )


def confirm(port: StationPort, place: tuple[Any, ...], session: Session) -> None:
    """Send the first datagrams of a session, which contain no data yet."""
    nan = math.nan
    for number in range(CONFIRMATIONS):
        empty = Datagram(
            Mode.DISCONNECTED, 0, NO_FAULT, session.number, number, nan, math.inf, nan, (nan,) * 3
        )
        port.send(pack(empty, session.send_key), place)
        time.sleep(PAUSE)


def listen(port: StationPort, key: bytes, own: Document, show: Show) -> Connection:
    """Wait until a master station begins a session; return it."""
    handshake, shown = SlaveHandshake(key, own), ""
    show(f"waits for the master station at {text_of(port.place)}; Ctrl-C ends")
    while True:
        select.select([port], [], [], None)
        for data, place, _ in port.receive(MOST):
            if answer := handshake.answer(data):
                port.send(answer, place)
                different = different_settings(own, handshake.settings)
                if different and different != shown:
                    show(f"refused the master at {text_of(place)}: {different}")
                shown = different
            elif session := handshake.receive(data):
                others = handshake.settings
                if not different_settings(own, others):
                    longest = common_round_trip(own, others)
                    return Connection(port, place, session, "slave", longest, others)


def different_settings(own: Document, others: Document) -> str:
    """Return how the settings of both stations differ, one line for each; empty if they do not."""
    found = differences(own["settings"], others["settings"])
    return "\n".join(f"settings of the stations differ: {text}" for text in found)
