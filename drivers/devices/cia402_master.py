"""The CANopen master's part on a bus: one SYNC and one heartbeat for all drives on it."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

from drivers.codecs.cia402 import HEARTBEAT, SYNC, NmtState
from drivers.transports.can_bus import CanBus

NODE = 127
"""Our own node id."""
LONGEST = 8e-3
"""After this long without a SYNC one is sent even if no tick ends [s], so that samples come."""


class Master:
    """What the drives on a bus have in common.

    A tick ends with the last drive's command: the SYNC then makes all drives take the command
    that they were sent and sample what they answer. The last is the one that was started last,
    as drives transmit in the order in which they are started.

    Attributes
    ----------
    synchronised
        When the latest SYNC was sent [s].
    armed
        Whether a drive was enabled: from then on our heartbeat is sent at the end of a tick, and
        the drives, which begin to watch it with the first, miss it if ticks stay away.
    """

    def __init__(self) -> None:
        self.synchronised = -math.inf
        self.armed = False
        self._last = ""
        self._heartbeat = -math.inf
        self._period = math.inf

    def join(self, drive: str, heartbeat_period: float) -> None:
        """Count with a drive, by its name; our heartbeat is sent at least at its period [s]."""
        self._last, self.armed = drive, False
        self._period = min(self._period, heartbeat_period)

    def end_tick(self, drive: str, bus: CanBus) -> None:
        """Synchronise all drives if this is the last of them, and send our heartbeat if due."""
        if drive != self._last:
            return
        self.synchronise(bus)
        now = bus.now()
        if self.armed and now - self._heartbeat >= self._period:
            self._heartbeat = now
            bus.send(HEARTBEAT + NODE, bytes((NmtState.OPERATIONAL,)))

    def keep_sampling(self, bus: CanBus, now: float) -> None:
        """Send a SYNC that is overdue as no tick ends."""
        if now - self.synchronised > LONGEST:
            self.synchronise(bus)

    def synchronise(self, bus: CanBus) -> None:
        """Send a SYNC."""
        self.synchronised = bus.now()
        bus.send(SYNC, b"")


_masters: WeakKeyDictionary[CanBus, Master] = WeakKeyDictionary()


def master_of(bus: CanBus) -> Master:
    """The one master on a bus."""
    return _masters.setdefault(bus, Master())
