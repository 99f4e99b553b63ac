"""What the other station means for this one: when the drives may be armed, and when they stop.

The slave is armed first, at rest, and then the master. A station stops its drives if the other one
stops or has a fault. Each station moves its own drives only.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from teleop.names import SideName
from teleop.safety import Fault, Mode, Verdict
from teleop.safety.channels import DetectedFault
from teleop.safety.events import ACTIVE, FAULT, READY, SEVERITY, STOPPING
from teleop.station.datagram import CONSENT, ENDING, NO_FAULT
from teleop.station.keys import OTHERS
from teleop.station.peer import Peer
from teleop.station.round_trip import RoundTrip

FRESH = 0.1
"""Greatest age of the newest datagram with which the drives may be armed [s]."""
LEFT = 5.0
"""Time without data after which a station that is not armed ends, because the other one has ended
[s]."""
WAITING = 10.0
"""Longest time for which an armed slave waits at rest until the master is armed [s]."""
GOODBYES = 5
"""Number of datagrams at the end of a run, with which the other station learns of the end."""
FAULTS = tuple(Fault)


def fault_name(rank: int) -> str:
    """Return the name of a fault in a datagram, which can be that of another version."""
    return FAULTS[rank] if rank < len(FAULTS) else "a fault"


class ConnectionValues(NamedTuple):
    """Values of the connection that a station records at one tick.

    `teleop.streams.columns.STATION_COLUMNS` states the meaning and the unit of each value.
    """

    station_clock: float
    sent_datagrams: float
    received_datagram: float
    other_mode: float
    offset_low: float
    offset_high: float
    round_trip: float
    lost_datagrams: float
    overtaken_datagrams: float
    rejected_datagrams: float


class Station:
    """A station in a session.

    `longest` is the longest permitted round trip [s], of both stations.
    """

    def __init__(self, side: SideName, peer: Peer, longest: float = math.inf) -> None:
        self.side = side
        self.peer = peer
        self.longest = longest
        self.other = f"{OTHERS[side]} station"
        self.trip = RoundTrip()
        self.lag = 0.0
        """Time for which the slave waits before it uses a motion that has arrived [s]."""
        self.echo = math.nan
        """Time in the datagram of the other station whose data are used here [s]."""
        self.reason = ""
        """Reason why the run ends here, because of the other station; empty if there is none."""
        self.faults: tuple[DetectedFault, ...] = ()
        """Faults that the other station causes here."""
        self.arms = False
        """Whether the other station permits to arm the drives."""
        self.waits_for = "the first data"
        """What is missing before the drives may be armed; empty if nothing is."""
        self._flags = 0
        self._mode = Mode.DISCONNECTED
        self._fault = NO_FAULT
        self._values: tuple[float, ...] = (0.0,) * (3 if side == "master" else 7)
        self._armed = self._followed = False
        self._since = math.nan

    @property
    def armed(self) -> bool:
        """Whether the drives of this station have been armed."""
        return self._armed

    def read(self, consent: bool, ending: bool) -> None:
        """Read what the other station has sent, and judge what it means.

        `consent`: whether a person here has permitted the drives to move. `ending`: whether the
        run here ends. The control loop calls this method at the start of each tick.
        """
        self._flags = CONSENT * consent | ENDING * ending
        peer = self.peer
        peer.receive()
        now, newest = peer.now(), peer.newest
        if not newest:
            return
        self.trip.add(now, now - newest.echo + self.lag)
        if self._mode is ACTIVE:
            self._watch(now, newest.mode, bool(newest.flags & ENDING), newest.fault)
        if self._armed:
            return
        if now - self.peer.heard > LEFT:
            self.reason = f"the {self.other} has sent nothing for {LEFT:g} s"
        elif newest.flags & ENDING or newest.mode is FAULT:
            self.reason = f"the {self.other} ended before the drives were armed"
            if newest.fault != NO_FAULT:
                self.reason += f": {fault_name(newest.fault)}"
        self.waits_for = self._missing(now, newest.mode, bool(newest.flags & CONSENT))
        self.arms = not self.waits_for

    def _missing(self, now: float, mode: Mode, consent: bool) -> str:
        """Return what is missing before the drives may be armed; empty if nothing is."""
        if now - self.peer.heard > FRESH:
            return f"data of the {self.other}"
        if not consent:
            return f"the person at the {self.other}, who arms its drives"
        largest = self.trip.largest
        if not largest < math.inf:
            return "the measurement of the round trip"
        if largest > self.longest:
            return (
                f"a shorter round trip: {largest * 1e3:.1f} ms, expected at most "
                f"{self.longest * 1e3:.1f} ms"
            )
        wanted = ACTIVE if self.side == "master" else READY
        if mode is not wanted:
            return f"the {self.other} to be {wanted.name.lower()}: it is {mode.name.lower()}"
        return ""

    def _watch(self, now: float, mode: Mode, ending: bool, fault: int) -> None:
        """Stop the drives if the other station does not control its own any more."""
        nan = math.nan
        if mode is FAULT:
            source = f"the {self.other} has stopped: {fault_name(fault)}"
            self.faults = (DetectedFault(Fault.OTHER_STATION, source, nan, nan, now),)
        elif mode is ACTIVE:
            self._followed = True
            if ending:
                self.reason = f"the {self.other} ends"
        elif self._followed or ending or mode is STOPPING:
            self.reason = f"the {self.other} has stopped"
        elif now - self._since > WAITING:
            self.reason = f"the {self.other} was not armed within {WAITING:g} s"
        if self.trip.mean > self.longest:
            mean, most = self.trip.mean, self.longest
            source = f"round trip {mean * 1e3:.1f} ms, at most {most * 1e3:.1f} ms"
            self.faults += (DetectedFault(Fault.CHANNEL_SLOW, source, mean, most, now),)

    def send(self, verdict: Verdict, values: tuple[float, ...]) -> None:
        """Send the mode of the supervisor and the values of a tick to the other station."""
        state = verdict.state
        if state.mode is ACTIVE and not self._armed:
            self._armed, self._since = True, self.peer.now()
        self._mode, self._values = state.mode, values
        self._fault = SEVERITY[state.causes[0].fault] if state.causes else NO_FAULT
        self.peer.send(self._mode, self._flags, values, self.echo, self._fault)

    def finish(self) -> None:
        """Send the other station that the run here has ended."""
        for _ in range(GOODBYES):
            self.peer.send(self._mode, self._flags | ENDING, self._values, self.echo, self._fault)

    def values(self, now: float) -> ConnectionValues:
        """Return the recorded values of the connection at the tick at the time `now` [s]."""
        peer, offset = self.peer, self.peer.offset()
        newest = peer.newest
        return ConnectionValues(
            now,
            float(peer.sent),
            float(newest.sequence) if newest else math.nan,
            float(newest.mode) if newest else math.nan,
            offset.low,
            offset.high,
            self.trip.newest,
            float(peer.window.lost),
            float(peer.overtaken),
            float(sum(peer.rejected.values())),
        )
