"""Bounds of the offset between the clocks of two stations.

Let o be the time on the clock of this station minus that of the other one. A datagram of the other
station with the delay D >= 0 has the difference r - s = D + o of receive time and send time.
Therefore o is at most the smallest difference. In the same way, -o is at most the smallest
difference that the other station found, which each of its datagrams contains. The interval of o
contains the true offset whatever the delays are, also if those of the two directions differ. Its
width is the sum of the smallest delays of both directions.

The clocks drift apart. A bound therefore becomes wider with time, by at most `DRIFT`.

References
----------
F. Cristian, "Probabilistic clock synchronization", Distributed Computing 3, 1989.
"""

from __future__ import annotations

import math
from typing import NamedTuple

DRIFT = 100e-6
"""Largest rate at which the clocks of the two stations drift apart [s/s]. The quartz of a computer
has an error of at most 50 ppm."""


class Interval(NamedTuple):
    """Interval that contains a value."""

    low: float
    high: float

    @property
    def width(self) -> float:
        """Width of the interval."""
        return self.high - self.low


UNKNOWN = Interval(-math.inf, math.inf)


class OffsetBound:
    """Smallest difference of receive time and send time, an upper bound of the clock offset."""

    def __init__(self) -> None:
        self._bound = math.inf
        self._time = -math.inf

    def add(self, now: float, difference: float) -> None:
        """Add the difference [s] of a datagram that was received at the time `now` [s]."""
        bound = self.at(now)
        self._bound = difference if difference < bound else bound
        self._time = now if now > self._time else self._time

    def at(self, now: float) -> float:
        """Return the bound at the time `now` [s]; infinite before the first datagram."""
        age = now - self._time
        return self._bound + DRIFT * age if age > 0.0 else self._bound


def offset_interval(own: float, others: float, age: float) -> Interval:
    """Return the interval of the time here minus the time at the other station [s].

    `own` is the bound of this station now, and `others` that in a datagram of the other station,
    which it sent at most `age` [s] ago.
    """
    return Interval(-others - DRIFT * age, own)
