"""Store which open live page has control, and whether this page may start a trial.

A client is a live page that is open in a browser. Only the client that has control may send
requests such as `start` (see `teleop.live.requests.IN_CONTROL`). Every client may request `stop`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from teleop.live.clients import ALIVE, Client

UNLOCKED = 2.0
"""Time for which the request `start` is accepted after a person pressed the button Unlock [s]."""


class Control:
    """Stores which client (open live page) has control. At most one client has control.

    Only the client that has control may send requests such as `start`.

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
        """Give control of the trials to a client, unless another client has control.

        Return whether `client` now has control.
        """
        if self.holder is None:
            self.holder = client
            self.lock()
            self.beat(client)
        return self.holder is client

    def release(self, client: Client) -> bool:
        """End the control by a client, so that no client has control.

        Return False, and change nothing, if `client` did not have control.
        """
        if self.holder is not client:
            return False
        self.holder = None
        self.lock()
        return True

    def beat(self, client: Client) -> bool:
        """Process a heartbeat, which is a message that an open live page sends at regular times.

        If `client` has control, the time of the heartbeat is stored. Return whether `client` has
        control.
        """
        if self.holder is client:
            self._beat = self._now()
        return self.holder is client

    @property
    def is_silent(self) -> bool:
        """Whether a client has control, but its last heartbeat is more than `ALIVE` seconds ago.

        A heartbeat is a message that an open live page sends at regular times.
        """
        return self.holder is not None and self._now() - self._beat > ALIVE

    @property
    def unlocked(self) -> bool:
        """Whether the request `start` of the live page, which arms the drives, is accepted now."""
        return self._now() - self._unlocked <= UNLOCKED

    def unlock(self) -> None:
        """Accept the request `start`, which arms the drives, for the next `UNLOCKED` seconds.

        The button Unlock of the live page causes this call.
        """
        self._unlocked = self._now()

    def lock(self) -> None:
        """Refuse the request `start`, which arms the drives, until the next call of `unlock`."""
        self._unlocked = -math.inf

    def of(self, client: Client) -> str:
        """Return who has control, as a text for a message to a client.

        The text is `you` for this client, `other` for another client, and `none` for no client.
        """
        if self.holder is None:
            return "none"
        return "you" if self.holder is client else "other"
