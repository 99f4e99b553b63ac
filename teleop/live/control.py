"""Which client has control, and whether it may start a trial."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from teleop.live.clients import ALIVE, Client

UNLOCKED = 2.0
"""Time after UNLOCK within which START is accepted [s]."""


class Control:
    """At most one client has control.

    Parameters
    ----------
    now
        Returns the present time [s].

    Attributes
    ----------
    holder
        The client in control; None for none.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.holder: Client | None = None
        self._now = now
        self._beat = self._unlocked = -math.inf

    def ask(self, client: Client) -> bool:
        """Give control to a client if nobody has it, and return whether the client has it."""
        if self.holder is None:
            self.holder = client
            self.lock()
            self.beat(client)
        return self.holder is client

    def release(self, client: Client) -> bool:
        """Take control from a client, and return whether it had control."""
        if self.holder is not client:
            return False
        self.holder = None
        self.lock()
        return True

    def beat(self, client: Client) -> bool:
        """Note the heartbeat of a client, and return whether it has control."""
        if self.holder is client:
            self._beat = self._now()
        return self.holder is client

    @property
    def is_silent(self) -> bool:
        """Whether there is a client in control whose page has stopped to send heartbeats."""
        return self.holder is not None and self._now() - self._beat > ALIVE

    @property
    def unlocked(self) -> bool:
        """Whether START is accepted now."""
        return self._now() - self._unlocked <= UNLOCKED

    def unlock(self) -> None:
        """Accept START for the next `UNLOCKED` seconds."""
        self._unlocked = self._now()

    def lock(self) -> None:
        """Do not accept START."""
        self._unlocked = -math.inf

    def of(self, client: Client) -> str:
        """Return who has control, for a client: you, other or none."""
        if self.holder is None:
            return "none"
        return "you" if self.holder is client else "other"
