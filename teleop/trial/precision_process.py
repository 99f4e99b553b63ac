"""The process that evaluates the record of a running trial in real time.

    python -m teleop.trial.precision_process

Standard input has one JSON document per line: a description of the session, and the event at which
the drives are armed. The ticks are in a ring buffer in shared memory. On standard output, the
process states that it is ready, and then each evaluation.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from teleop.live.control_pipe import ControlPipe
from teleop.live.ring import RingReader
from teleop.live.shared_file import SharedFile
from teleop.recording.recording import from_messages
from teleop.trial.precision_watch import PrecisionWatch, watch_of

NICENESS = 5
"""Increase of the niceness of this process, which lowers its priority."""
PERIOD = 0.05
"""Time between two reads of the ring buffer [s]."""


class Evaluation:
    """Reads the ticks in the ring buffer, and evaluates them when this is due."""

    def __init__(self, session: dict[str, Any], ring: RingReader) -> None:
        self._session, self._ring = session, ring
        self._read = 0
        self._watch: PrecisionWatch | None = None

    def receive(self, document: dict[str, Any]) -> None:
        """Begin to evaluate when the drives are armed."""
        self._watch = watch_of(self._session, document["armed"])

    def leave(self) -> None:
        """Continue until the process ends: nobody reads the findings any more."""

    def advance(self) -> dict[str, Any] | None:
        """Read the new ticks; return the finding of an evaluation, None if it was not due."""
        if self._watch is None:
            return None
        first, end = max(self._read + 1, self._ring.oldest), self._ring.newest + 1
        found, slots = self._ring.read(range(first, end))
        if not found:
            return None
        # the ring is read from its oldest tick on, so that ticks are missing only before the first
        is_after_gap, self._read = found[0] > self._read + 1 > 1, found[-1]
        size = int(slots["length"][0])
        messages = np.ascontiguousarray(slots["message"][:, :size]).tobytes()
        ticks = from_messages(self._session["definition"], messages, [], {})
        self._watch.add(ticks.columns, is_after_gap)
        t = float(ticks["time"][-1])
        return self._watch.evaluate(t)._asdict() if self._watch.is_due(t) else None


def main() -> None:
    """Evaluate until the control process has ended."""
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    pipe = ControlPipe()
    try:
        session = pipe.read_line()
    except EOFError:  # the control process has ended before
        return
    file = SharedFile.open(Path(session["file"]), writable=False)
    evaluation = Evaluation(session, RingReader(file.buffer, *session["ring"]))
    pipe.send({"ready": True})
    pipe.stop_waiting()
    while not pipe.is_over:
        pipe.receive_into(evaluation)
        if finding := evaluation.advance():
            pipe.send(finding)
        time.sleep(PERIOD)


if __name__ == "__main__":
    main()
