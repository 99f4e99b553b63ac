"""Judge the measured round trip of the data between two stations.

The round trip is the age of the oldest data in the loop: the time since this station sent the data
that the other station used for the newest datagram that has arrived here. It is measured with one
clock, and contains the delays of both directions, the waiting for the ticks of both stations, lost
datagrams, and the playout at the slave.
"""

from __future__ import annotations

import math

BLOCK = 0.5
"""The largest round trip is that of the last one to two blocks of this length [s]."""
AVERAGING = 0.1
"""Time constant of the mean round trip [s]. A single late datagram does not make a loop unstable,
and a longer delay does."""


class RoundTrip:
    """Largest and mean round trip of a session."""

    def __init__(self) -> None:
        self.newest = math.nan
        """Round trip of the latest tick [s]."""
        self.mean = math.nan
        """Exponential average of the round trip [s]."""
        self._block = self._before = -math.inf
        self._began = self._time = math.nan

    @property
    def largest(self) -> float:
        """Largest round trip of the last 0.5 to 1 s; infinite before it has been measured [s]."""
        return max(self._before, self._block) if self._before > -math.inf else math.inf

    def add(self, now: float, trip: float) -> None:
        """Add the round trip [s] of the tick at the time `now` [s]; NaN if it is not known."""
        self.newest = trip
        if trip != trip:
            return
        if self._began != self._began:
            self._began = self._time = now
            self.mean = trip
        weight = min((now - self._time) / AVERAGING, 1.0)
        self.mean += (trip - self.mean) * weight
        self._time = now
        if now - self._began >= BLOCK:
            self._before, self._block, self._began = self._block, -math.inf, now
        self._block = max(self._block, trip)
