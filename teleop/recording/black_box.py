"""Define the black box, which keeps the ticks shortly before and after a fault in memory."""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path
from typing import Any

from teleop.files import unwritable
from teleop.recording.columns import Layout
from teleop.recording.mcap_writer import McapFile
from teleop.recording.recording import Recording, from_messages
from teleop.recording.sinks import Outcome, Sink, event_record, reported_fault
from teleop.safety import Event

BEFORE, AFTER = 5.0, 1.0
"""Duration of the stored part of a trial before a fault, and after the fault [s]."""


class BlackBox(Sink):
    """Keeps the latest ticks, for the time `BEFORE` + `AFTER`, and all events of a trial.

    It does not depend on the recorder process. The loop ends when the time `AFTER` after a fault
    has elapsed. The kept ticks are then those before and after the fault.
    """

    def __init__(self, layout: Layout, rate: float) -> None:
        self._layout = layout
        self._messages: deque[bytes] = deque(maxlen=math.ceil((BEFORE + AFTER) * rate) + 1)
        self._events: list[dict[str, Any]] = []

    def push(self, message: bytes) -> None:
        """Keep the message of a tick; the oldest message is deleted if there are too many."""
        self._messages.append(message)

    def event(self, event: Event) -> None:
        """Keep an event."""
        self._events.append(event_record(event))

    def close(self) -> Outcome:
        """Return the number of kept ticks. There is no file to close."""
        return Outcome(None, len(self._messages), 0, "")

    @property
    def fault(self) -> dict[str, Any] | None:
        """Event of the reported fault (see `reported_fault`); None if there was no fault."""
        return reported_fault(self._events)

    def recording(self, metadata: dict[str, dict[str, str]]) -> Recording:
        """Return the kept ticks and events as a recording."""
        messages = b"".join(self._messages)
        return from_messages(self._layout.definition, messages, self._events, metadata)

    def write(self, path: Path, metadata: dict[str, dict[str, str]], start: int) -> None:
        """Write the kept data to a file; `start` is the wall-clock time of t = 0 [ns]."""
        layout, recording = self._layout, self.recording(metadata)
        try:
            file = McapFile(path, layout.columns, layout.definition, metadata, overwrite=True)
            file.begin(start)
            for message, t in zip(self._messages, recording["time"].tolist(), strict=True):
                file.tick(message, t)
            for event in self._events:
                file.event(event)
            file.close()
        except OSError as error:
            raise unwritable(path, error) from error
        if file.error:
            raise unwritable(path, file.error)
