"""Base class of serial ports and CAN buses, which are read once per tick of the control loop."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

POLL_PERIOD = 0.5e-3
"""Time between two readings of the bus during `wait_for` [s]."""


class Bus(ABC):
    """A serial port or CAN bus."""

    def __init__(self, name: str, now: Callable[[], float]) -> None:
        self.name = name
        self.now = now
        self.nap: Callable[[float], object] = time.sleep
        """Function that `wait_for` calls with the time [s] to wait between two readings."""
        self.pump: Callable[[], object] = self.poll
        """Function that `wait_for` calls to read the bus. In a rig, it reads all buses."""

    @abstractmethod
    def open(self) -> None:
        """Connect to the port or the CAN adapter."""

    @abstractmethod
    def poll(self) -> None:
        """Pass all received data to the devices, without waiting."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect. This method may also be called after `open` failed."""

    def wait_for(self, condition: Callable[[], object], seconds: float) -> bool:
        """Read the bus repeatedly until a condition is true, or until the longest wait has passed.

        This method waits. Call it only to set up devices, before the control loop starts.
        """
        end = self.now() + seconds
        while not condition():
            if self.now() > end:
                return False
            self.nap(POLL_PERIOD)
            self.pump()
        return True
