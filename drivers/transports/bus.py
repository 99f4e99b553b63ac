"""Base class of serial ports and CAN buses, which are read once per tick."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

POLL_PERIOD = 0.5e-3
"""Polling period while waiting for an answer [s]."""


class Bus(ABC):
    """A serial port or CAN bus.

    Parameters
    ----------
    name
        Name of the bus in the rig file.
    now
        Function that returns the time of the controller's clock [s].
    """

    def __init__(self, name: str, now: Callable[[], float]) -> None:
        self.name = name
        self.now = now
        self.nap: Callable[[float], object] = time.sleep
        """Function that waits for a time [s] between two readings."""
        self.pump: Callable[[], object] = self.poll
        """Function that reads this bus, and on a rig with several buses also the others."""

    @abstractmethod
    def open(self) -> None:
        """Connect; raise RigError if this fails."""

    @abstractmethod
    def poll(self) -> None:
        """Pass all received data to the devices, without waiting.

        Raises
        ------
        RigError
            The port is disconnected, or the bus is off.
        """

    @abstractmethod
    def close(self) -> None:
        """Disconnect, also after an `open` that failed."""

    def wait_for(self, condition: Callable[[], object], seconds: float) -> bool:
        """Poll until a condition is true or a time has passed; return whether it is true.

        It is used for the set-up before the loop. A tick never waits.
        """
        end = self.now() + seconds
        while not condition():
            if self.now() > end:
                return False
            self.nap(POLL_PERIOD)
            self.pump()
        return True
