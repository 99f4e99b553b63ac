"""CANopen master of a bus. It sends SYNC and the controller's heartbeat for all drives."""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

from drivers.codecs.cia402 import HEARTBEAT, SYNC, NmtState
from drivers.transports.can_bus import CanBus

NODE = 127
"""Node id of the controller."""
LONGEST = 8e-3
"""`keep_sampling` sends a SYNC if there was no SYNC during this time [s]."""


class Master:
    """CANopen master. All drives on a bus share one master.

    At the end of a tick, after the command of the last drive, the master sends SYNC. All drives
    then apply their commands and take their samples. Commands are sent to the drives in the order
    in which the drives were started, so the last drive is the drive that was started last.

    Attributes
    ----------
    synchronised
        Time of the latest SYNC on the controller's clock [s].
    armed
        Whether a drive was enabled. If so, the controller's heartbeat is sent periodically, at the
        end of a tick. After the first heartbeat, the drives monitor the heartbeat, and so detect
        missing ticks.
    """

    def __init__(self) -> None:
        self.synchronised = -math.inf
        self.armed = False
        self._last = ""
        self._heartbeat = -math.inf
        self._period = math.inf

    def join(self, drive: str, heartbeat_period: float) -> None:
        """Add a drive to the bus.

        Parameters
        ----------
        drive
            Name of the device.
        heartbeat_period
            Longest period of the controller's heartbeat that the drive permits [s].
        """
        self._last, self.armed = drive, False
        self._period = min(self._period, heartbeat_period)

    def end_tick(self, drive: str, bus: CanBus) -> None:
        """If this drive is the last drive on the bus, send SYNC, and the heartbeat if it is due.

        Parameters
        ----------
        drive
            Name of the device whose command has been sent.
        bus
            The bus.
        """
        if drive != self._last:
            return
        self.synchronise(bus)
        now = bus.now()
        if self.armed and now - self._heartbeat >= self._period:
            self._heartbeat = now
            bus.send(HEARTBEAT + NODE, bytes((NmtState.OPERATIONAL,)))

    def keep_sampling(self, bus: CanBus, now: float) -> None:
        """Send a SYNC if the time since the latest SYNC is longer than 8 ms (`LONGEST`)."""
        if now - self.synchronised > LONGEST:
            self.synchronise(bus)

    def synchronise(self, bus: CanBus) -> None:
        """Send a SYNC, and store the time."""
        self.synchronised = bus.now()
        bus.send(SYNC, b"")


_masters: WeakKeyDictionary[CanBus, Master] = WeakKeyDictionary()


def master_of(bus: CanBus) -> Master:
    """Return the CANopen master of a bus. The first call for a bus creates the master."""
    return _masters.setdefault(bus, Master())
