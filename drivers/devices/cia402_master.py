"""CANopen master: one SYNC and one heartbeat for all drives on a bus."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

from drivers.codecs.cia402 import HEARTBEAT, SYNC, NmtState
from drivers.transports.can_bus import CanBus

NODE = 127
"""Node id of the controller."""
LONGEST = 8e-3
"""Longest time between two SYNC messages [s], also if no tick ends."""


class Master:
    """State that all drives on a bus share.

    SYNC is sent at the end of a tick, after the command of the last drive. All drives then apply
    their commands and take their samples. Drives send in the order in which they were started, so
    the last drive is the one that was started last.

    Attributes
    ----------
    synchronised
        Time of the latest SYNC [s].
    armed
        Whether a drive was enabled. Then the controller's heartbeat is sent at the end of a tick.
        The drives monitor it from the first one on, and detect missing ticks.
    """

    def __init__(self) -> None:
        self.synchronised = -math.inf
        self.armed = False
        self._last = ""
        self._heartbeat = -math.inf
        self._period = math.inf

    def join(self, drive: str, heartbeat_period: float) -> None:
        """Add a drive by its name, with the longest period of the controller's heartbeat [s]."""
        self._last, self.armed = drive, False
        self._period = min(self._period, heartbeat_period)

    def end_tick(self, drive: str, bus: CanBus) -> None:
        """If this is the last drive, send SYNC, and the heartbeat if it is due."""
        if drive != self._last:
            return
        self.synchronise(bus)
        now = bus.now()
        if self.armed and now - self._heartbeat >= self._period:
            self._heartbeat = now
            bus.send(HEARTBEAT + NODE, bytes((NmtState.OPERATIONAL,)))

    def keep_sampling(self, bus: CanBus, now: float) -> None:
        """Send a SYNC if the last one is older than `LONGEST`."""
        if now - self.synchronised > LONGEST:
            self.synchronise(bus)

    def synchronise(self, bus: CanBus) -> None:
        """Send a SYNC, and store its time."""
        self.synchronised = bus.now()
        bus.send(SYNC, b"")


_masters: WeakKeyDictionary[CanBus, Master] = WeakKeyDictionary()


def master_of(bus: CanBus) -> Master:
    """Return the master of a bus."""
    return _masters.setdefault(bus, Master())
