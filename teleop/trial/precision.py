"""End a trial when the result of the evaluation is as precise as wanted.

In virtual time, the record is evaluated within the loop, so that the same seed gives the same end.
In real time, another process evaluates it:

    python -m teleop.trial.precision
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from teleop.streams.reader import Reader, Send, run_reader
from teleop.streams.stream import StreamReader, columns_of

if TYPE_CHECKING:
    from teleop.trial.precision_watch import PrecisionWatch

SOURCE = "precision"
"""Source of the events that state the precision."""


NICENESS = 5
"""Increase of the niceness of the process, which lowers its priority."""
PERIOD = 0.05
"""Time between two reads of the stream in real time [s]."""


class Precision(Reader):
    """Evaluates the ticks of a stream again and again, from the moment when the drives are armed.

    `session` has the `wanted` precision as text, the `metadata` of the recording, and the
    `duration` of the trial. Each message is a `teleop.trial.precision_watch.Finding`.
    """

    def __init__(self, session: Mapping[str, Any], stream: StreamReader, send: Send) -> None:
        super().__init__(stream, send)
        self._session = session
        stream.patience = 0.0  # the evaluation needs no estimates
        self._watch: PrecisionWatch | None = None

    def is_due(self, t: float) -> bool:
        """Return whether `advance` must be called when the newest tick is at t [s]."""
        return self._watch is None or self._watch.is_due(t)

    def advance(self) -> None:
        """Read the new ticks, and evaluate them if this is due."""
        t = 0.0
        while batch := self.stream.read():
            for _, event in batch.events:
                if self._watch is None and event["mode"] == "active":
                    from teleop.trial.precision_watch import watch_of  # imports scipy: slow

                    self._watch = watch_of(self._session, self.stream.schema, event)
            if self._watch and len(batch.rows):
                columns = columns_of(self.stream.schema, batch.rows)
                self._watch.add(columns, batch.is_after_gap)
                t = float(columns["time"][-1])
        if self._watch and t and self._watch.is_due(t):
            self.send(self._watch.evaluate(t)._asdict())


if __name__ == "__main__":
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    import teleop.trial.precision_watch  # noqa: F401  imports scipy, which takes long

    run_reader("evaluation", Precision, PERIOD)
