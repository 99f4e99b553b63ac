"""The readers of the stream of a running trial: in the process of the loop, or in other processes.

In virtual time, the readers run in the process of the loop, after each block of ticks, so that the
same seed gives the same result. In real time, each is a process of its own, which cannot delay the
loop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from estimation import Bank
from teleop.control.tick_record import Record
from teleop.errors import InputError
from teleop.recording.recorder import Recorder
from teleop.safety import Event, Mode
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.child_process import ChildProcess
from teleop.streams.estimation import BLOCK, Estimation, StreamEstimation, session_of
from teleop.streams.stream import Stream
from teleop.trial.precision import SOURCE as PRECISION
from teleop.trial.precision import Precision

ESTIMATION = "estimation"
"""Source of the events about a failure of the estimation."""
MODULES = {
    ESTIMATION: "teleop.streams.estimation",
    "recorder": "teleop.recording.recorder",
    "evaluation": "teleop.trial.precision",
}
"""Modules of the processes."""
CHECK = 0.1
"""Time between two checks whether the other processes run [s]."""
LATE = 1.0
"""Delay of the estimates above which an event states it [s]."""
CLOSING = 20.0
"""Longest time for which the recorder may write the rest of a recording [s]."""


class Outcome(NamedTuple):
    """Result of a recording: its file, the number of missed ticks, and a problem, if any."""

    path: Path | None = None
    """The file of the recording; None if the ticks are not written to a file."""
    dropped: int = 0
    """Number of ticks that the recorder has missed."""
    problem: str = ""
    """Reason why ticks are missing from the file; empty if no tick that was read is missing."""
    at_path: bool = True
    """Whether the file is still at `path`."""


class Readers:
    """No readers, as in a rehearsal.

    Attributes
    ----------
    end_reason
        Reason for which a reader ends the trial; empty while none does.
    failure
        Text about an exception of an estimator, or the end of the estimation; empty if there was
        none.
    traceback
        Traceback of this exception.
    estimation_pid
        Process of the estimation; None if it is this process.
    """

    def __init__(self) -> None:
        self.end_reason = self.failure = self.traceback = ""
        self.estimation_pid: int | None = None

    def begin(self, start: int) -> None:
        """Begin to read. `start` is the expected time of the first tick, Unix time [ns]."""

    def after_tick(self, record: Record) -> None:
        """Let the readers read, or check that they do."""

    def close(self) -> Outcome:
        """Let all readers read the rest of the stream, and end them."""
        return Outcome()


class ReadersOfTrial(Readers):
    """What the readers of a trial have in common, wherever they run."""

    def __init__(self, stream: Stream, settings: TrialSettings, path: str | None) -> None:
        super().__init__()
        self._stream = stream
        self._until = settings.until
        self._path = path
        self._time, self._mode = 0.0, Mode.IDLE
        """Time [s] and mode of the latest tick that was looked at."""

    @property
    def _recording_failed(self) -> str:
        return f"{self._path or 'progress line'}: recording failed"

    def _receive(self, name: str, message: Mapping[str, Any] | None) -> None:
        """Process a message of a reader; None if its process has ended."""
        message = message or {"failure": f"the {name} was killed", "traceback": ""}
        if "failure" not in message:
            assert self._until
            text = message["text"]
            self._note(PRECISION, f"{self._until.text}: {text}")
            if message["is_reached"]:
                self.end_reason = text
        elif name == "recorder":
            self.end_reason = self.end_reason or f"{self._path or name}: {message['failure']}"
        elif name == ESTIMATION:
            self.failure, self.traceback = message["failure"], message["traceback"]
            self._note(ESTIMATION, f"no further estimates: {self.failure}")
        else:  # the trial then has its full duration
            self._note(PRECISION, f"no longer evaluated: {message['failure']}")

    def _note(self, source: str, text: str) -> None:
        self._stream.event(Event(self._time, self._mode, text, source=source))


class ReadersInLoop(ReadersOfTrial):
    """Readers of a trial in virtual time."""

    def __init__(
        self,
        stream: Stream,
        settings: TrialSettings,
        bank: Bank,
        recording: Mapping[str, Any] | None = None,
        precision: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(stream, settings, recording["path"] if recording else None)
        estimation = Estimation(settings.make_conditioner(), bank)
        self._estimation = StreamEstimation(
            estimation, stream.reader(), partial(self._receive, ESTIMATION)
        )
        send = partial(self._receive, "recorder")
        try:
            self._recorder = Recorder(recording, stream.reader(), send) if recording else None
        except InputError as error:
            raise InputError(f"{self._recording_failed}: {error}") from error
        send = partial(self._receive, "evaluation")
        self._precision = Precision(precision, stream.reader(), send) if precision else None
        self._due = 0

    def begin(self, start: int) -> None:
        """Begin the recording."""
        if self._recorder:
            self._recorder.begin(start)

    def after_tick(self, record: Record) -> None:
        """Let the readers read if there is a block of new ticks, or an evaluation is due."""
        self._time, self._mode = record.t, record.mode
        if self._precision and self._precision.is_due(record.t):
            self._precision.advance()
        if self._stream.newest >= self._due:
            self._due = self._stream.newest + BLOCK
            self._estimation.advance()
            if self._recorder:
                self._recorder.advance()

    def close(self) -> Outcome:
        """Let the readers read the last ticks."""
        status = None
        try:
            self._estimation.finish()
        finally:
            if self._recorder:
                status = self._recorder.finish()
        return outcome_of(self._path, status) if status else Outcome()


class ReadersInProcesses(ReadersOfTrial):
    """Readers of a trial in real time."""

    def __init__(
        self,
        stream: Stream,
        settings: TrialSettings,
        recording: Mapping[str, Any] | None,
        precision: Mapping[str, Any] | None,
    ) -> None:
        super().__init__(stream, settings, recording["path"] if recording else None)
        self._late = LATE * settings.loop_rate
        self._ticks, self._every = 0, math.ceil(CHECK * settings.loop_rate)
        self._is_late = False
        self._ended: set[str] = set()
        """Names of the processes that have ended during the trial."""
        preset, conditioner = settings.estimation_preset, settings.make_conditioner()
        sessions = {
            ESTIMATION: session_of(preset, conditioner),
            "recorder": recording,
            "evaluation": precision,
        }
        self._sessions = {name: session for name, session in sessions.items() if session}
        self._processes: dict[str, ChildProcess] = {}
        try:
            for name in self._sessions:
                what = self._recording_failed if name == "recorder" else name
                self._processes[name] = ChildProcess(MODULES[name], what)
        except InputError:
            self._end()
            raise
        self.estimation_pid = self._processes[ESTIMATION].pid

    def begin(self, start: int) -> None:
        """Wait until all processes are ready, so that their start does not delay the loop."""
        for name, process in self._processes.items():
            stream = self._stream.document
            process.begin({**self._sessions[name], "stream": stream, "start": start})
            process.move_off()

    def after_tick(self, record: Record) -> None:
        """Look for messages of the processes, and whether they run, once per `CHECK` seconds."""
        self._ticks += 1
        if self._ticks % self._every:
            return
        self._time, self._mode = record.t, record.mode
        for name, process in self._processes.items():
            if process.has_message and name not in self._ended:
                message = process.wait_for_request(0.0)
                if message is None:
                    self._ended.add(name)
                self._receive(name, message)
        was_late = self._is_late
        self._is_late = self._stream.newest - self._stream.estimated > self._late
        if self._is_late and not (was_late or self.failure):
            self._note(ESTIMATION, f"the estimates are more than {LATE:g} s late")

    def close(self) -> Outcome:
        """Wait until the processes have read the last ticks, the estimation first."""
        try:
            self._last_message(ESTIMATION)
            if "recorder" not in self._processes:
                return Outcome()
            status = self._last_message("recorder") or {"problem": "the recorder was killed"}
            return outcome_of(self._path, status)
        finally:
            self._end()

    def _last_message(self, name: str) -> Mapping[str, Any] | None:
        """Wait for the end of a process; return its last message, or None if it was killed."""
        messages = self._processes[name].finish(CLOSING)
        last = messages.pop() if messages and "problem" in messages[-1] else None
        for message in messages:
            if "problem" not in message:  # else it states that the process has started
                self._receive(name, message)
        if last is None and name not in self._ended:
            self._receive(name, None)
        return last

    def _end(self) -> None:
        for process in self._processes.values():
            process.end()


def outcome_of(path: str | None, status: Mapping[str, Any]) -> Outcome:
    """Return the result of a recording from the last message of the recorder."""
    file = Path(path) if path else None
    dropped, at_path = status.get("dropped", 0), status.get("at_path", True)
    return Outcome(file, dropped, status["problem"], at_path)
