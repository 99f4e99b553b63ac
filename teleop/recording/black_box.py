"""Define the black box, which stores the ticks shortly before and after a fault in memory."""

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
    """Stores the latest ticks and all events of a trial in memory.

    The black box does not depend on the recorder, which is the process that writes all ticks to a
    file. The stored ticks cover the time `BEFORE` + `AFTER`. The loop ends when the time `AFTER`
    after a fault has elapsed. The stored ticks are then those before and after the fault.

    Parameters
    ----------
    layout
        Layout of the message of a tick: its columns, and how they are packed into bytes.
    rate
        Ticks per second [Hz].
    """

    def __init__(self, layout: Layout, rate: float) -> None:
        self._layout = layout
        self._messages: deque[bytes] = deque(maxlen=math.ceil((BEFORE + AFTER) * rate) + 1)
        self._events: list[dict[str, Any]] = []

    def push(self, message: bytes) -> None:
        """Store the message of one tick. If the memory is full, the oldest message is deleted."""
        self._messages.append(message)

    def event(self, event: Event) -> None:
        """Store an event (a fault, or a change of the supervisor's mode)."""
        self._events.append(event_record(event))

    def close(self) -> Outcome:
        """Return an `Outcome` in which `pushed` is the number of stored ticks.

        Other sinks complete and close their file here. The black box has no open file.
        """
        return Outcome(None, len(self._messages), 0, "")

    @property
    def fault(self) -> dict[str, Any] | None:
        """Event of the reported fault (see `reported_fault`); None if there was no fault."""
        return reported_fault(self._events)

    def recording(self, metadata: dict[str, dict[str, str]]) -> Recording:
        """Return the stored ticks and events as a recording.

        Parameters
        ----------
        metadata
            Metadata records, by their names, for example `session` and `settings`. Each record is
            a dictionary of texts.
        """
        messages = b"".join(self._messages)
        return from_messages(self._layout.definition, messages, self._events, metadata)

    def write(self, path: Path, metadata: dict[str, dict[str, str]], start: int) -> None:
        """Write the stored ticks and events to an MCAP file. An existing file is overwritten.

        Parameters
        ----------
        path
            The file.
        metadata
            Metadata records, by their names, for example `session` and `settings`. Each record is
            a dictionary of texts.
        start
            Wall-clock time of the beginning of the trial, as nanoseconds since 1970 (Unix time).

        Raises
        ------
        InputError
            The file cannot be written.
        """
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
