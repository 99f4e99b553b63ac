"""Base class of ports and buses, which are read once per tick of the control loop."""

from __future__ import annotations

import contextlib
import hashlib
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from drivers.claims import claim, claimant, process_text
from drivers.rig import RigError

if TYPE_CHECKING:
    from drivers.device import Device

POLL_PERIOD = 0.5e-3
"""Time between two readings of the bus during `wait_for` [s]."""


class Bus(ABC):
    """A serial port, a CAN bus, or a connection to a device on a network."""

    def __init__(self, name: str, now: Callable[[], float]) -> None:
        self.name = name
        self.now = now
        self.nap: Callable[[float], object] = time.sleep
        """Function that `wait_for` calls with the time [s] to wait between two readings."""
        self.pump: Callable[[], object] = self.poll
        """Function that `wait_for` calls to read the bus. In a rig, it reads all buses."""
        self.log: Callable[[str, str], object] | None = None
        """Function that gets each transmission as text, after `<` (received) or `>` (sent)."""
        self._held = contextlib.ExitStack()

    @property
    def occupied(self) -> float:
        """Time for which the line has carried data so far [s]; NaN if its bit rate is not known.

        It is computed from the number of transmitted bits. Use differences of it.
        """
        return math.nan

    @abstractmethod
    def open(self) -> None:
        """Connect to the port, the CAN adapter or the device."""

    @abstractmethod
    def poll(self) -> None:
        """Pass all received data to the devices, without waiting."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect. This method may also be called after `open` failed."""

    @abstractmethod
    def connect(self, device: Any) -> None:
        """Pass the data of a device to it from now on."""

    def start(self, device: Any) -> None:
        """Set up a connected device."""
        device.start(self)

    def transmit(self, devices: Sequence[Device]) -> None:
        """Let devices of this bus send their commands."""
        for device in devices:
            device.transmit()

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

    def _claim(self, identity: str, what: str) -> None:
        """Claim the bus until `self._held` is closed; raise RigError if another process has it.

        Two processes could otherwise send commands to the same drives. Only Linux has such claims.
        Emulated devices do not claim their bus.
        """
        name = f"bus {hashlib.sha256(identity.encode()).hexdigest()[:32]}"
        try:
            held = claim(name)
        except (AttributeError, OSError):  # a system without these claims
            return
        if held is None:
            raise RigError(
                f"{self.name}: {what} is used by {process_text(claimant(name) or 0)}: expected a "
                "bus that no other process uses"
            )
        self._held.enter_context(held)
