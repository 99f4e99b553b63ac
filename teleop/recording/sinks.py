"""Sinks: they receive the ticks and events of the loop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, NamedTuple

from teleop.json_documents import finite
from teleop.safety import Event

LONGEST_TEXT = 400
"""Largest number of characters in the text of an event."""


class Outcome(NamedTuple):
    """State of a recording at its end."""

    path: Path | None
    """The file; None if there is none."""
    pushed: int
    """Number of ticks that the sink received."""
    dropped: int
    """Number of ticks that were dropped because the pipe was full."""
    problem: str
    """Reason why the file does not contain all received ticks; empty if it does."""
    at_path: bool = True
    """Whether the file is still at its path."""


class Sink(ABC):
    """Receives the ticks and events of the loop, without making the loop wait for a disk."""

    dropped = 0
    """Number of ticks that were dropped."""

    @abstractmethod
    def push(self, message: bytes) -> None:
        """Receive the message of one tick."""

    @abstractmethod
    def event(self, event: Event) -> None:
        """Receive an event."""

    @abstractmethod
    def close(self) -> Outcome:
        """Finish and return the state of the recording."""


class Memory(Sink):
    """Stores all ticks and events in memory.

    Attributes
    ----------
    messages
        The concatenated messages of all ticks.
    events
        All events, as values of JSON.
    """

    def __init__(self) -> None:
        self.messages = bytearray()
        self.events: list[dict[str, Any]] = []
        self._pushed = 0

    def push(self, message: bytes) -> None:
        """Store the message of one tick."""
        self.messages += message
        self._pushed += 1

    def event(self, event: Event) -> None:
        """Store an event."""
        self.events.append(event_record(event))

    def close(self) -> Outcome:
        """Return the outcome, with the number of stored ticks."""
        return Outcome(None, self._pushed, 0, "")


def event_record(event: Event) -> dict[str, Any]:
    """Return an event as values of JSON, with texts of limited length."""
    record: dict[str, Any] = finite(event._asdict())
    return record | {
        "mode": event.mode.name.lower(),
        "text": event.text[:LONGEST_TEXT],
        "fault": event.fault and str(event.fault),
        "source": event.source[:100],
    }
