"""Show the person at a station what is missing before the drives may be armed."""

from __future__ import annotations

import threading
from typing import Self

from teleop.control.clock import Clock, RealClock
from teleop.printable import print_error
from teleop.station.connection import Connection
from teleop.station.station import Station

INTERVAL = 0.5
"""Time between two looks [s]."""


class Waiting:
    """Shows what a station waits for, until its drives are armed.

    A thread looks at the station twice per second. It ends when the drives are armed, so that it
    does not disturb the control loop.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._station: Station | None = None
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        # also after an error before the loop: the other one must not wait
        station = self._station or self._connection.begin(RealClock(1.0))
        station.finish()
        self._end.set()
        if self._station:
            self._thread.join()

    def begin(self, clock: Clock) -> Station:
        """Return the station for a control loop with this clock, and begin to look at it."""
        self._station = self._connection.begin(clock)
        self._thread.start()
        return self._station

    @property
    def station(self) -> Station | None:
        """The station; None before the control loop."""
        return self._station

    def _look(self) -> None:
        station, shown = self._station, ""
        assert station
        while not (self._end.wait(INTERVAL) or station.armed or station.reason):
            text = station.waits_for
            if text and text != shown:
                print_error(f"waits for {text}")
            shown = text
