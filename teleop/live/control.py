"""Store which client of the live page has control, and whether this client may start a trial."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from teleop.live.clients import ALIVE, Client

UNLOCKED = 2.0
"""Time for which START is accepted after a person pressed UNLOCK [s]."""


class Control:
    """Stores the client that has control. At most one client has control.

    Parameters
    ----------
    now
        Function that returns the present time [s].

    Attributes
    ----------
    holder
        The client in control; None if no client has control.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.holder: Client | None = None
        self._now = now
        self._beat = self._unlocked = -math.inf

    def ask(self, client: Client) -> bool:
        """Give control to a client unless another client has control.

        Return whether the client now has control.
        """
        if self.holder is None:
            self.holder = client
            self.lock()
            self.beat(client)
        return self.holder is client

    def release(self, client: Client) -> bool:
        """Take control from a client; return whether the client had control."""
        if self.holder is not client:
            return False
        self.holder = None
        self.lock()
        return True

    def beat(self, client: Client) -> bool:
        """Return whether the client has control. If it has, store the time of this heartbeat."""
        if self.holder is client:
            self._beat = self._now()
        return self.holder is client

    @property
    def is_silent(self) -> bool:
        """Whether a client has control but has sent no heartbeat for longer than `ALIVE`."""
        return self.holder is not None and self._now() - self._beat > ALIVE

    @property
    def unlocked(self) -> bool:
        """Whether START is accepted now."""
        return self._now() - self._unlocked <= UNLOCKED

    def unlock(self) -> None:
        """Accept START for the next `UNLOCKED` seconds."""
        self._unlocked = self._now()

    def lock(self) -> None:
        """Refuse START until the next call of `unlock`."""
        self._unlocked = -math.inf

    def of(self, client: Client) -> str:
        """Return who has control, for a message to a client: `you`, `other` or `none`."""
        if self.holder is None:
            return "none"
        return "you" if self.holder is client else "other"
