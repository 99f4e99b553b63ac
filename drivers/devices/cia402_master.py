"""CANopen master of a bus. It sends SYNC frames and the controller's heartbeat to all drives."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

from drivers.codecs.cia402 import HEARTBEAT, SYNC, NmtState
from drivers.transports.can_bus import CanBus

NODE = 127
"""Node id of the controller."""
LONGEST = 8e-3
"""`keep_sampling` sends a SYNC if there was no SYNC during this time [s]."""


class CanopenMaster:
    """CANopen master. All drives on a bus share one master.

    At each tick, each drive object sends its command, in the order in
    which the drives were started. After the last command, the master sends a SYNC frame. All drives
    then apply their commands and take their samples.

    Attributes
    ----------
    synchronised
        Time of the latest SYNC on the controller's clock [s].
    armed
        Whether a drive has been enabled since the last call of `join`. If so, the controller's
        heartbeat is sent periodically, at the end of a tick. A drive monitors this heartbeat as
        soon as it has received the first one. The drive then stops if the control loop stops.
    """

    def __init__(self) -> None:
        self.synchronised = -math.inf
        self.armed = False
        self._last = ""
        self._heartbeat = -math.inf
        self._period = math.inf

    def join(self, drive: str, heartbeat_period: float) -> None:
        """Add a drive. Drives are added in the order in which their commands are sent."""
        self._last, self.armed = drive, False
        self._period = min(self._period, heartbeat_period)

    def end_tick(self, drive: str, bus: CanBus) -> None:
        """Send SYNC after the command of the last drive on the bus.

        Also send the controller's heartbeat, if a drive has been enabled and the period of the
        heartbeat has elapsed. If `drive` is not the last drive, do nothing.
        """
        if drive != self._last:
            return
        self.synchronise(bus)
        now = bus.now()
        if self.armed and now - self._heartbeat >= self._period:
            self._heartbeat = now
            bus.send(HEARTBEAT + NODE, bytes((NmtState.OPERATIONAL,)))

    def keep_sampling(self, bus: CanBus, now: float) -> None:
        """Send a SYNC if the latest SYNC is older than 8 ms (`LONGEST`).

        The drives take samples at each SYNC. This method therefore causes samples to be sent even
        if no commands are sent. `now` is the present time on the controller's clock [s].
        """
        if now - self.synchronised > LONGEST:
            self.synchronise(bus)

    def synchronise(self, bus: CanBus) -> None:
        """Send a SYNC frame, and store its time in `synchronised`."""
        self.synchronised = bus.now()
        bus.send(SYNC, b"")


_masters: WeakKeyDictionary[CanBus, CanopenMaster] = WeakKeyDictionary()


def master_of(bus: CanBus) -> CanopenMaster:
    """Return the CANopen master of a bus. The first call for a bus creates the master."""
    return _masters.setdefault(bus, CanopenMaster())
