"""Recognise datagrams that were lost, overtaken by newer ones, or received before.

A duplicate of a datagram, and a replay by an attacker, have a number that was received before. The
numbers of the newest datagrams are known exactly. A datagram that is older than these counts as
received before (RFC 4303, section 3.4.3, has the same window).
"""

from __future__ import annotations

from enum import Enum

LENGTH = 1024
"""Number of the newest datagrams whose reception is known; at 1 kHz, about 1 s."""
MASK = (1 << LENGTH) - 1


class Arrival(Enum):
    """How a datagram arrived, compared with those before."""

    NEWEST = "newest"
    """It is newer than all others."""
    OVERTAKEN = "overtaken"
    """It was not received before, but a newer one was."""
    REPEATED = "repeated"
    """It was received before, or is too old to know this."""


NEWEST, OVERTAKEN, REPEATED = Arrival


class SequenceWindow:
    """Numbers of the datagrams that were received in a session."""

    def __init__(self) -> None:
        self.newest = -1
        """Largest number that was received; -1 before the first one."""
        self.received = 0
        """How many different datagrams were received."""
        self._first = 0
        self._seen = 0
        """Bit n is set if the number `newest` - n was received."""

    @property
    def lost(self) -> int:
        """Datagrams since the first one that were not received.

        One that is overtaken counts until it arrives.
        """
        return self.newest - self._first + 1 - self.received if self.received else 0

    def add(self, number: int) -> Arrival:
        """Add the number of a datagram whose signature is valid; return how it arrived."""
        ahead = number - self.newest
        if not self.received:
            self._first = number
        if ahead > 0:
            self._seen = (self._seen << ahead | 1) & MASK if ahead < LENGTH else 1
            self.newest = number
            self.received += 1
            return NEWEST
        bit = 1 << -ahead
        if -ahead >= LENGTH or self._seen & bit or number < self._first:
            return REPEATED
        self._seen |= bit
        self.received += 1
        return OVERTAKEN
