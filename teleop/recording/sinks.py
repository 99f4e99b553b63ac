"""Sinks, which are objects that receive the ticks and events of the control loop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from teleop.json_documents import finite
from teleop.safety import Event, Fault

LONGEST_TEXT = 400
"""Largest number of characters in the text of an event."""


class Outcome(NamedTuple):
    """Result of a recording: its file, the numbers of ticks, and a problem, if any."""

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

    `push` and `event` do not write to a disk: a slow disk must not delay a loop in real time.
    """

    dropped = 0
    """Number of ticks that were dropped and therefore not recorded."""
    end_reason = ""
    """Reason for which this sink ends the trial; empty while it does not."""

    @abstractmethod
    def push(self, message: bytes) -> None:
        """Receive the message of one tick (see `teleop.recording.columns.Layout`)."""

    @abstractmethod
    def event(self, event: Event) -> None:
        """Receive an event: a fault, or a change of the mode of the safety supervisor."""

    @abstractmethod
    def close(self) -> Outcome:
        """End the recording. Return the numbers of ticks and a problem, if there is one."""


class Memory(Sink):
    """Keeps the messages of all ticks, one after another, and all events (`event_record`)."""

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
        """Return the number of kept ticks. There is no file to close."""
        return Outcome(None, self._pushed, 0, "")


def reported_fault(events: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """Return the event of the fault that a trial reports; None if there was no fault.

    This is the first fault, because later faults can be its effects. There is one exception: if the
    slave moved after the stop, this is reported.
    """
    faults = [event for event in events if event["fault"]]
    worst = (event for event in faults if event["fault"] == Fault.MOVES_AFTER_STOP)
    return next(worst, faults[0] if faults else None)


def event_record(event: Event) -> dict[str, Any]:
    """Return an event as a dictionary of values that JSON allows. Long texts are shortened."""
    record: dict[str, Any] = finite(event._asdict())
    return record | {
        "mode": event.mode.name.lower(),
        "text": event.text[:LONGEST_TEXT],
        "fault": event.fault and str(event.fault),
        "source": event.source[:100],
    }
