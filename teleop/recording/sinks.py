"""Sinks, which are objects that receive the ticks and events of the control loop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, NamedTuple

from teleop.json_documents import finite
from teleop.safety import Event

LONGEST_TEXT = 400
"""Largest number of characters in the text of an event."""

BEGIN = "recording"
"""Text of the event that marks the beginning of a recording."""


class Outcome(NamedTuple):
    """State of a recording after its end."""

    path: Path | None
    """The file of the recording; None if the ticks are not written to a file."""
    pushed: int
    """Number of ticks that the sink received."""
    dropped: int
    """Number of ticks that were dropped because the pipe was full."""
    problem: str
    """Reason why received ticks are missing from the file; empty if no received tick is missing."""
    at_path: bool = True
    """Whether the file is still at `path`."""


class Sink(ABC):
    """Base class of objects that receive the ticks and events of the control loop.

    The methods `push` and `event` do not write to a disk. The control loop therefore never waits
    for a disk.
    """

    dropped = 0
    """Number of ticks that were dropped and therefore not recorded."""

    @abstractmethod
    def push(self, message: bytes) -> None:
        """Receive the message of one tick."""

    @abstractmethod
    def event(self, event: Event) -> None:
        """Receive an event."""

    @abstractmethod
    def close(self) -> Outcome:
        """Complete the recording, and return its state."""


class Memory(Sink):
    """Stores all ticks and events in memory.

    Attributes
    ----------
    messages
        Messages of all ticks, one after another.
    events
        All events, each as a dictionary of JSON values, see `event_record`.
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
        """Return the number of stored ticks. There is nothing to close, because no file is open."""
        return Outcome(None, self._pushed, 0, "")


def event_record(event: Event) -> dict[str, Any]:
    """Return an event as a dictionary of JSON values. Long texts are shortened."""
    record: dict[str, Any] = finite(event._asdict())
    return record | {
        "mode": event.mode.name.lower(),
        "text": event.text[:LONGEST_TEXT],
        "fault": event.fault and str(event.fault),
        "source": event.source[:100],
    }
