"""The readers of the stream of a running trial: in the process of the loop, or in other processes.

In virtual time, the readers run in the process of the loop, after each block of ticks, so that the
same seed gives the same result. In real time, each is a process of its own, which cannot delay the
loop.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from estimation import Bank
from teleop.errors import InputError
from teleop.recording.recorder import Recorder
from teleop.safety import Event
from teleop.safety.events import ACTIVE
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.child_process import ChildProcess
from teleop.streams.estimation import BLOCK, Estimation, StreamEstimation
from teleop.streams.estimation_process import session_of
from teleop.streams.stream import Stream
from teleop.trial.precision import SOURCE as PRECISION
from teleop.trial.precision import PrecisionReader

ESTIMATION = "estimation"
"""Source of the events about a failure of the estimation."""
CHECK = 100
"""Number of ticks between two checks whether the other processes run."""
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

    def after_tick(self, t: float) -> None:
        """Let the readers read, or check that they do. The latest tick is at t [s]."""

    def close(self) -> Outcome:
        """Let all readers read the rest of the stream, and end them."""
        return Outcome()


class ReadersOfTrial(Readers):
    """What the readers of a trial have in common, wherever they run."""

    def __init__(self, stream: Stream, settings: TrialSettings) -> None:
        super().__init__()
        self._stream = stream
        self._until = settings.until

    def _fail(self, t: float, text: str, trace: str = "") -> None:
        """State once that there are no estimates from now on."""
        if not self.failure:
            self.failure, self.traceback = text, trace
            note = f"no further estimates: {text}"
            self._stream.event(Event(t, ACTIVE, note, source=ESTIMATION))

    def _state(self, t: float, text: str, is_reached: bool) -> None:
        """State the precision of the result so far, and end the trial if it is as wanted."""
        assert self._until
        self._stream.event(Event(t, ACTIVE, f"{self._until.text}: {text}", source=PRECISION))
        if is_reached:
            self.end_reason = text


class ReadersInLoop(ReadersOfTrial):
    """Readers of a trial in virtual time."""

    def __init__(
        self,
        stream: Stream,
        settings: TrialSettings,
        bank: Bank,
        recording: dict[str, Any] | None = None,
        precision: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(stream, settings)
        reader = stream.reader()
        self._estimation = StreamEstimation(
            stream.schema,
            reader.ticks,
            stream.estimates_writer(),
            Estimation(settings.make_conditioner(), bank),
        )
        self._recorder = Recorder(recording, reader) if recording else None
        self._path = recording["path"] if recording else None
        self._precision = PrecisionReader(precision, stream.reader()) if precision else None
        self._due = 0
        self._time = 0.0
        """Time of the latest tick [s]."""

    def begin(self, start: int) -> None:
        """Begin the recording."""
        if self._recorder:
            self._recorder.begin(start)

    def after_tick(self, t: float) -> None:
        """Let the readers read if there is a block of new ticks, or an evaluation is due."""
        self._time = t
        precision = self._precision
        if precision and precision.is_due(t) and (finding := precision.evaluate()):
            self._state(t, *finding)
        if self._stream.newest >= self._due:
            self._due = self._stream.newest + BLOCK
            self._advance()

    def _advance(self) -> None:
        while self._estimation.advance():
            pass
        if self._estimation.failure[0]:
            self._fail(self._time, *self._estimation.failure)
        if self._recorder:
            self._recorder.advance()

    def close(self) -> Outcome:
        """Let the readers read the last ticks."""
        status: dict[str, Any] = {"problem": ""}
        try:
            self._advance()
        finally:
            if self._recorder:
                status = self._recorder.finish()
        return outcome_of(self._path, status)


class ReadersInProcesses(ReadersOfTrial):
    """Readers of a trial in real time."""

    def __init__(
        self,
        stream: Stream,
        settings: TrialSettings,
        recording: dict[str, Any] | None,
        precision: dict[str, Any] | None,
    ) -> None:
        super().__init__(stream, settings)
        self._rate = settings.loop_rate
        self._path = recording["path"] if recording else None
        self._ticks = 0
        self._is_late = False
        self._processes: dict[str, ChildProcess] = {}
        preset, conditioner = settings.estimation_preset, settings.make_conditioner()
        self._sessions = {"estimation": session_of(preset, conditioner)}
        modules = {"estimation": "teleop.streams.estimation_process"}
        if recording:
            modules["recorder"] = "teleop.recording.recorder_process"
            self._sessions["recorder"] = recording
        if precision:
            modules["precision"] = "teleop.trial.precision_process"
            self._sessions["precision"] = precision
        names = {"recorder": f"{self._path or 'progress line'}: recording failed"}
        try:
            for name, module in modules.items():
                self._processes[name] = ChildProcess(module, names.get(name, name))
        except InputError:
            self._end()
            raise
        self.estimation_pid = self._processes["estimation"].pid

    def begin(self, start: int) -> None:
        """Wait until all processes are ready, so that their start does not delay the loop."""
        for name, process in self._processes.items():
            process.begin({**self._sessions[name], "stream": self._stream.document})
            process.move_off()
        if recorder := self._processes.get("recorder"):
            recorder.tell({"start": start})

    def after_tick(self, t: float) -> None:
        """Look for messages of the processes, and whether they run, once per `CHECK` ticks."""
        self._ticks += 1
        if self._ticks % CHECK:
            return
        processes = self._processes
        for name in ("recorder", "precision"):
            if name in processes and processes[name].has_message:
                answer = processes[name].wait_for_request(0.0)
                if name == "precision" and answer:
                    self._state(t, answer["text"], answer["is_reached"])
                elif not self.end_reason:
                    cause = answer["failure"] if answer else f"the {name} was killed"
                    self.end_reason = f"{self._sessions[name].get('path') or name}: {cause}"
        self._check_estimation(t)

    def _check_estimation(self, t: float) -> None:
        process = self._processes["estimation"]
        if not self.failure and process.has_message:
            answer = process.wait_for_request(0.0)
            failed = (answer["failure"], answer["traceback"]) if answer else ("it was killed",)
            self._fail(t, *failed)
        is_late = self._stream.newest - self._stream.estimated > LATE * self._rate
        if is_late and not (self._is_late or self.failure):
            text = f"the estimates are more than {LATE:g} s late"
            self._stream.event(Event(t, ACTIVE, text, source=ESTIMATION))
        self._is_late = is_late

    def close(self) -> Outcome:
        """Wait until the processes have read the last ticks, the estimation first."""
        try:
            recorder = self._processes.get("recorder")
            self._processes["estimation"].finish(CLOSING)
            if not recorder:
                return Outcome()
            status = recorder.finish(CLOSING)
            return outcome_of(self._path, status or {"problem": "the recorder was killed"})
        finally:
            self._end()

    def _end(self) -> None:
        for process in self._processes.values():
            process.end()


def outcome_of(path: str | None, status: dict[str, Any]) -> Outcome:
    """Return the result of a recording from the last message of the recorder."""
    file = Path(path) if path else None
    dropped, at_path = status.get("dropped", 0), status.get("at_path", True)
    return Outcome(file, dropped, status["problem"], at_path)
