"""Sinks: what takes the ticks and events of the loop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, NamedTuple

from teleop.json_documents import finite
from teleop.safety import Event

LONGEST_TEXT = 400
"""Most characters in the text of an event."""


class Outcome(NamedTuple):
    """State of a recording at its end."""

    path: Path | None
    pushed: int
    """Ticks that the loop handed over."""
    dropped: int
    """Ticks that found the pipe full: they are not in the file."""
    problem: str
    """Why the file does not hold all ticks that were handed over; empty if it does."""
    at_path: bool = True
    """Whether the file is still at its path."""


class Sink(ABC):
    """Takes in the ticks and events of the loop; never makes the loop wait for a disk."""

    dropped = 0
    """Ticks that were not taken in."""

    @abstractmethod
    def push(self, message: bytes) -> None:
        """Take in the message of one tick."""

    @abstractmethod
    def event(self, event: Event) -> None:
        """Take in an event."""

    @abstractmethod
    def close(self) -> Outcome:
        """Finish; returns the state of the recording."""


class Memory(Sink):
    """Keeps everything."""

    def __init__(self) -> None:
        self.messages = bytearray()
        self.events: list[dict[str, Any]] = []
        self._pushed = 0

    def push(self, message: bytes) -> None:
        """Keep the message of one tick."""
        self.messages += message
        self._pushed += 1

    def event(self, event: Event) -> None:
        """Keep an event."""
        self.events.append(event_record(event))

    def close(self) -> Outcome:
        """Return that everything was kept."""
        return Outcome(None, self._pushed, 0, "")


def event_record(event: Event) -> dict[str, Any]:
    """Return an event as values of JSON."""
    record: dict[str, Any] = finite(event._asdict())
    return record | {
        "mode": event.mode.name.lower(),
        "text": event.text[:LONGEST_TEXT],
        "fault": event.fault and str(event.fault),
        "source": event.source[:100],
    }
