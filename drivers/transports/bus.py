"""What serial ports and CAN buses have in common: they are drained once a tick."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

NAP = 0.5e-3
"""Between two looks while waiting for an answer [s]."""


class Bus(ABC):
    """A port or bus.

    Parameters
    ----------
    name
        What the rig file calls it.
    now
        The controller's clock [s].
    """

    def __init__(self, name: str, now: Callable[[], float]) -> None:
        self.name = name
        self.now = now
        self.nap: Callable[[float], object] = time.sleep
        """Lets time pass [s] between two looks."""
        self.pump: Callable[[], object] = self.poll
        """Drains this bus, and on a rig of several the others too: their devices are waiting."""

    @abstractmethod
    def open(self) -> None:
        """Connect; RigError if that fails."""

    @abstractmethod
    def poll(self) -> None:
        """Hand on all that has arrived, without waiting.

        Raises
        ------
        RigError
            The port is gone, or the bus is off.
        """

    @abstractmethod
    def close(self) -> None:
        """Disconnect; also after an `open` that failed."""

    def wait_for(self, condition: Callable[[], object], seconds: float) -> bool:
        """Go on polling until a condition holds, at most this long; whether it does.

        For the set-up before the loop; a tick never waits.
        """
        end = self.now() + seconds
        while not condition():
            if self.now() > end:
                return False
            self.nap(NAP)
            self.pump()
        return True
