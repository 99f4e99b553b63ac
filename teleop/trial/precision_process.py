"""The process that evaluates the record of a running trial in real time.

python -m teleop.trial.precision_process
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from teleop.streams.control_pipe import run_reader
from teleop.streams.stream import StreamReader
from teleop.trial.precision import PrecisionReader

NICENESS = 5
"""Increase of the niceness of this process, which lowers its priority."""
PERIOD = 0.05
"""Time between two reads of the stream [s]."""


class PrecisionOfStream:
    """Evaluates the stream of another process."""

    def __init__(self, session: dict[str, Any], send: Callable[[dict[str, Any]], None]) -> None:
        self._reader = PrecisionReader(session, StreamReader.open(session["stream"], "precision"))
        self._send = send

    def receive(self, document: dict[str, Any]) -> None:
        """Ignore a message: there is none."""

    def leave(self) -> None:
        """Do nothing: nobody reads the findings any more."""

    def advance(self) -> None:
        """Evaluate the new ticks if this is due, and send the precision."""
        if finding := self._reader.evaluate():
            self._send(finding._asdict())

    def finish(self) -> dict[str, Any]:
        """Return an empty message: the trial has ended."""
        return {"problem": ""}


if __name__ == "__main__":
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    import teleop.trial.precision_watch  # noqa: F401  imports scipy, which takes long

    run_reader(PrecisionOfStream, PERIOD)
