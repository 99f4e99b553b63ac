"""The process that computes the estimates of a running trial in real time.

    python -m teleop.streams.estimation_process

While it is delayed, the estimates are late, and the loop is not.
"""

from __future__ import annotations

import base64
import contextlib
import pickle
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from estimation import Conditioner, Preset
from teleop.streams.columns import Schema
from teleop.streams.control_pipe import run_reader
from teleop.streams.estimation import Estimation, StreamEstimation
from teleop.streams.ring import RingReader, RingWriter
from teleop.streams.shared_file import SharedFile
from teleop.streams.stream import READERS, sections

PERIOD = 2e-3
"""Time between two reads of the stream [s]."""


def session_of(preset: Preset, conditioner: Conditioner) -> dict[str, Any]:
    """Return the session of the process, which lacks the document of the stream."""
    return {"parts": base64.b85encode(pickle.dumps((preset, conditioner))).decode()}


class EstimationReader:
    """Computes the estimates of a stream in another process."""

    def __init__(self, session: Mapping[str, Any], send: Callable[[dict[str, Any]], None]) -> None:
        preset, conditioner = pickle.loads(base64.b85decode(session["parts"]))
        stream = session["stream"]
        schema = Schema.of(stream["schema"])
        parts = sections(schema, stream["slots"])
        memory = {
            name: SharedFile.open(Path(stream["files"][name]), name != "ticks").buffer
            for name in ("ticks", "estimates", "missed")
        }
        self._missed = memoryview(memory["missed"]).cast("Q")
        self._estimation = StreamEstimation(
            schema,
            RingReader(memory["ticks"], *parts["ticks"]),
            RingWriter(memory["estimates"], *parts["estimates"]),
            Estimation(conditioner, preset.bank()),
        )
        self._send = send
        self._has_failed = False
        with contextlib.suppress(ImportError):
            import numba  # noqa: F401  a long backlog is then processed by compiled code

    def receive(self, document: dict[str, Any]) -> None:
        """Ignore a message: there is none."""

    def leave(self) -> None:
        """Do nothing: the last ticks follow in `finish`."""

    def advance(self) -> None:
        """Compute the estimates of the new ticks; report the first exception of an estimator."""
        self._estimation.advance()
        self._missed[READERS.index("estimation")] = self._estimation.missed
        text, trace = self._estimation.failure
        if text and not self._has_failed:
            self._has_failed = True
            self._send({"failure": text, "traceback": trace})

    def finish(self) -> dict[str, Any]:
        """Compute the estimates of the last ticks."""
        while self._estimation.advance():
            pass
        self.advance()
        return {"problem": ""}


if __name__ == "__main__":
    run_reader(EstimationReader, PERIOD)
