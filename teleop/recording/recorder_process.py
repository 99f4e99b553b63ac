"""The process that records a trial in real time, and shows the progress line.

    python -m teleop.recording.recorder_process

If the control process is killed, this process records all ticks that were written.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from teleop.recording.recorder import Recorder
from teleop.streams.control_pipe import run_reader
from teleop.streams.stream import StreamReader

NAP = 0.02
"""Time between two reads of the stream [s]."""


class RecorderReader(Recorder):
    """Records the stream of another process."""

    def __init__(self, session: Mapping[str, Any], send: Callable[[dict[str, Any]], None]) -> None:
        super().__init__(session, StreamReader.open(session["stream"], "recorder"))
        self._send = send
        self._has_failed = False

    def receive(self, document: dict[str, Any]) -> None:
        """Begin the recording."""
        self.begin(document["start"])

    def leave(self) -> None:
        """Do nothing: the last ticks follow in `finish`."""

    def advance(self) -> None:
        """Record the new ticks; report the first write error."""
        super().advance()
        if self.failure and not self._has_failed:
            self._has_failed = True
            self._send({"failure": self.failure})

    def finish(self) -> dict[str, Any]:
        """Record the last ticks, and return the status of the recording."""
        while self.is_behind:
            super().advance()
            time.sleep(1e-3)
        return super().finish()


if __name__ == "__main__":
    run_reader(RecorderReader, NAP)
