"""Write the ticks and events of a stream to an MCAP file, and show the progress line.

In real time, this is a process:

    python -m teleop.recording.recorder

If the control process is killed, it records all ticks that were written.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from teleop.errors import InputError, reason
from teleop.live.progress import Cue, Progress, Shown, Status
from teleop.recording.mcap_writer import McapFile
from teleop.safety.events import Mode, is_note
from teleop.streams.message import definition_of, messages_of
from teleop.streams.reader import Reader, Send, run_reader
from teleop.streams.stream import Batch, StreamReader

NAP = 0.02
"""Time between two reads of the stream in real time [s]."""
LAST_PATIENCE = 0.3
"""Longest time for which the last ticks wait for their estimates, after the end of a trial [s]."""
CHECK = 1.0
"""Time between two checks whether the file is still at its path [s]."""
FLUSH = 0.05
"""Time between two flushes of the file [s].

If the recorder is killed, the ticks after the last flush are lost. Each flush ends a chunk (block
of records) of the file. For each chunk, 200 bytes stay in memory until the end of the trial.
"""


class Recorder(Reader):
    """Records the stream of a trial, and shows the progress line.

    Parameters
    ----------
    session
        `path` of the file or None, `metadata` of the recording and whether to `overwrite` a file;
        whether to `show` the progress line, its `hint`, `instructions` and `cue`, and the
        `duration` of the trial.
    stream
        Reader of the stream.
    send
        Function that sends the first write error to the control process.

    Raises
    ------
    InputError
        The file cannot be created.
    """

    def __init__(self, session: Mapping[str, Any], stream: StreamReader, send: Send) -> None:
        super().__init__(stream, send)
        self._path = session["path"]
        self._file: McapFile | None = None
        if self._path:
            columns, metadata = stream.schema.columns, session["metadata"]
            try:
                self._file = McapFile(
                    Path(self._path),
                    columns,
                    definition_of(columns),
                    metadata,
                    session["overwrite"],
                )
            except OSError as refusal:
                raise InputError(reason(refusal)) from refusal
        self._progress = Progress(
            session["show"],
            session["duration"],
            session["hint"],
            session["instructions"],
            Cue(*session["cue"]) if session["cue"] else None,
        )
        self._ticks = 0
        self._flushed = self._checked = time.monotonic()
        self._is_reported = False
        self._names = [column.name for column in stream.schema.columns]
        self._last: Floats | None = None
        self._estimates: list[Shown] = []

    def begin(self, start: int) -> None:
        """Begin the recording. `start` is the expected time of the first tick, Unix time [ns]."""
        if self._file:
            self._file.begin(start)

    def advance(self) -> None:
        """Record the ticks and events that are new since the last call."""
        while batch := self.stream.read():
            self._add(batch)
        if self._file:
            self._monitor(self._file)

    def _add(self, batch: Batch) -> None:
        written = 0
        messages = messages_of(batch.rows) if self._file else []
        times = batch.rows[:, 0].tolist()
        for number, event in batch.events:
            if is_note(event["fault"], event["source"]):
                self._progress.note = event["text"]
            if self._file:
                until = max(written, min(number - batch.first + 1, len(messages)))
                self._write(self._file, messages[written:until], times[written:until])
                self._file.event(event)
                written = until
        if self._file:
            self._write(self._file, messages[written:], times[written:])
        if times:
            self._ticks += len(times)
            self._last = batch.rows[-1]
            self._progress.show(times[-1], self._status)

    @staticmethod
    def _write(file: McapFile, messages: list[bytes], times: list[float]) -> None:
        for message, t in zip(messages, times, strict=True):
            file.tick(message, t)

    def _monitor(self, file: McapFile) -> None:
        """Flush and check the file if it is time to do so; report the first problem.

        A problem is a write error, or a file that is no longer at its path.
        """
        now = time.monotonic()
        if now - self._flushed >= FLUSH:
            self._flushed = now
            file.flush()
        problem = file.failure
        if now - self._checked >= CHECK:
            self._checked = now
            problem = problem or file.missing
        if problem and not self._is_reported:
            self._is_reported = True
            ends = "the trial ends" if file.failure else "the run continues"
            self._progress.report(f"teleop: {self._path}: {problem}: {ends}")
            if file.failure:
                self.send({"failure": file.failure})

    def finish(self) -> dict[str, Any]:
        """Record the last ticks, close the file, and return the status of the recording.

        `problem` is a text or empty, `at_path` states whether the file is still at its path,
        `ticks` and `dropped` are the numbers of recorded and of missed ticks. A file without a tick
        is removed.
        """
        self.stream.patience = LAST_PATIENCE
        self.advance()
        while self.stream.is_behind:  # some estimates are not computed yet
            time.sleep(1e-3)
            self.advance()
        dropped = self.stream.missed
        status = {"problem": "", "at_path": True, "ticks": self._ticks, "dropped": dropped}
        if file := self._file:
            file.end(dropped)
            missing = file.missing
            file.close()
            if not (self._ticks or missing):
                file.remove()
            status |= {"problem": file.failure or missing, "at_path": not missing}
        self._progress.close()
        return status

    def _status(self) -> Status:
        assert self._last is not None
        tick = dict(zip(self._names, self._last.tolist(), strict=True))
        mode = Mode(int(tick["mode"]))
        estimates = [
            Shown(
                name,
                tick[f"{name}_k"],
                LEVEL_95 * tick[f"{name}_k_std"],
                tick[f"{name}_b"],
                LEVEL_95 * tick[f"{name}_b_std"],
                tick[f"{name}_misfit"],
            )
            for name in self.stream.schema.estimators
        ]
        without_sample = all(math.isnan(one.k) for one in estimates)
        if not (without_sample and mode is Mode.ACTIVE):
            self._estimates = estimates
        return Status(
            mode.name.lower(),
            tick["target"],
            tick["slave_position"],
            None if tick["contact"] == 0.0 else self._estimates,
        )


def in_process(session: Mapping[str, Any], stream: StreamReader, send: Send) -> Recorder:
    """Return the recorder for a process of its own."""
    recorder = Recorder(session, stream, send)
    recorder.begin(session["start"])
    return recorder


if __name__ == "__main__":
    run_reader("recorder", in_process, NAP)
