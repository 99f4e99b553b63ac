"""End a trial when the result of the evaluation is as precise as wanted.

In virtual time, the record is evaluated within the loop, so that the same seed gives the same end.
In real time, another process evaluates it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from teleop.safety.events import is_note
from teleop.streams.stream import StreamReader, columns_of

if TYPE_CHECKING:
    from teleop.trial.precision_watch import Finding, PrecisionWatch

SOURCE = "precision"
"""Source of the events that state the precision."""


class PrecisionReader:
    """Evaluates the ticks of a stream again and again, from the moment when the drives are armed.

    `session` has the `wanted` precision as text, the `metadata` of the recording, and the
    `duration` of the trial.
    """

    def __init__(self, session: Mapping[str, Any], stream: StreamReader) -> None:
        self._session = session
        self._stream = stream
        stream.patience = 0.0  # the evaluation needs no estimates
        self._watch: PrecisionWatch | None = None

    def is_due(self, t: float) -> bool:
        """Return whether `evaluate` must be called when the newest tick is at t [s]."""
        return self._watch is None or self._watch.is_due(t)

    def evaluate(self) -> Finding | None:
        """Read the new ticks; return the precision so far, or None if no evaluation is due."""
        t = 0.0
        while batch := self._stream.read():
            for _, event in batch.events:
                if (
                    self._watch is None
                    and event["mode"] == "active"
                    and not is_note(event["fault"], event["source"])
                ):
                    from teleop.trial.precision_watch import watch_of  # imports scipy: slow

                    self._watch = watch_of(self._session, self._stream.schema, event)
            if self._watch and len(batch.rows):
                columns = columns_of(self._stream.schema, batch.rows)
                self._watch.add(columns, batch.is_after_gap)
                t = float(columns["time"][-1])
        return self._watch.evaluate(t) if self._watch and t and self._watch.is_due(t) else None
