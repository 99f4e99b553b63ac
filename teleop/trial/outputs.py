"""Pass the ticks of a trial to the sinks: recorder, memory, black box and live page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from estimation import Bank
from teleop.errors import InputError
from teleop.files import FAULT_REPORT, unwritable
from teleop.recording.black_box import BlackBox
from teleop.recording.columns import Layout
from teleop.recording.recorder import RecorderProcess
from teleop.recording.recording import Recording, from_messages
from teleop.recording.recording_file import RecordingFile, recorded_ticks
from teleop.recording.sinks import Memory, Outcome, Sink
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.later_estimates import LaterEstimates
from teleop.trial.live_link import LiveLink
from teleop.trial.metadata import session_metadata
from teleop.trial.precision import Precision, PrecisionInLoop, PrecisionProcess
from teleop.trial.stop_switch import StopSwitch


class Outputs:
    """Creates the sinks of a trial, closes them, and provides what they kept.

    The ticks are recorded by another process (`record`), or kept in memory. The black box keeps
    those before and after a fault. `live` and the progress line (`show`) only show them.
    """

    def __init__(
        self,
        settings: TrialSettings,
        layout: Layout,
        bank: Bank,
        switch: StopSwitch,
        record: Path | None,
        overwrite: bool,
        show: bool,
        live: LiveLink | None,
        further: Sequence[Sink] = (),
    ) -> None:
        self._record = record
        self._layout = layout
        self._metadata = session_metadata(settings)
        self._start = 0
        self._recorder = None
        if record or show:
            target = settings.target
            self._recorder = RecorderProcess(
                record,
                layout,
                self._metadata,
                settings.duration,
                show,
                settings.clock == "virtual",
                overwrite,
                switch.hint,
                "" if switch.explained else switch.instructions,
                (target.depth, target.count_in) if target else None,
            )
        self._memory = None if record else Memory()
        self._box = BlackBox(layout, settings.loop_rate)
        # the recorder first: `close` reads its outcome
        self._sinks: list[Sink] = [
            sink for sink in (self._recorder, self._memory, self._box, live, *further) if sink
        ]
        self.later: LaterEstimates | None = None
        """Computes the estimates after the ticks; None if they are computed within each tick."""
        if settings.clock == "virtual" and not live:
            conditioner = settings.make_conditioner()
            self.later = LaterEstimates(conditioner, bank, layout, self._sinks)
        self._precision: Precision | None = None
        if settings.until:
            in_loop = settings.clock == "virtual"
            kind = PrecisionInLoop if in_loop else PrecisionProcess
            self._precision = kind(
                settings.until,
                layout,
                self._metadata,
                settings.duration,
                settings.loop_rate,
                self.sinks,
            )
        self.outcome = Outcome(None, 0, 0, "")
        self.black_box: Path | None = None
        """Folder with the ticks before and after a fault; None if none was written."""
        self.black_box_problem = ""
        """Reason why the black box could not be written."""

    @property
    def sinks(self) -> Sequence[Sink]:
        """What receives the ticks from the loop."""
        others: list[Sink] = [self.later] if self.later else self._sinks
        return [*others, self._precision] if self._precision else others

    @property
    def recorder_pid(self) -> int | None:
        """Process of the recorder, if there is one."""
        return self._recorder.process.pid if self._recorder else None

    @property
    def fault(self) -> dict[str, Any] | None:
        """Event of the fault that the trial reports."""
        return self._box.fault

    def begin(self, start: int) -> None:
        """Begin the recording. `start` is the expected time of the first tick, Unix time [ns]."""
        self._start = start
        if self._recorder:
            self._recorder.begin(start)
        if self._precision:
            self._precision.begin()

    def close(self, ticks: int) -> None:
        """Close all sinks, whatever fails. `ticks` is the number of ticks of the loop."""
        self.outcome = Outcome(None, ticks, 0, "")
        try:
            if self._precision:
                self._precision.close()
            if self.later:
                self.later.close()
        finally:
            outcomes = [sink.close() for sink in self._sinks]
            if self._record:
                self.outcome = outcomes[0]

    def ticks(self) -> Recording | RecordingFile:
        """Return all ticks; those of the black box if the file of the recording was lost."""
        if self._memory:
            messages, events = self._memory.messages, self._memory.events
            return from_messages(self._layout.definition, messages, events, self._metadata)
        assert self._record
        recorded = recorded_ticks(self._record) if self.outcome.at_path else None
        return recorded or self._box.recording(self._metadata)

    def write_black_box(self) -> None:
        """Write the ticks around a fault, and its report, to a folder beside the recording."""
        if not (self._record and self._box.fault):
            return
        from teleop.output.fault_report import draw_fault_report, write_fault_report

        folder = self._record.with_suffix(FAULT_REPORT)
        try:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise unwritable(folder, error) from error
            self._box.write(folder / "ticks.mcap", self._metadata, self._start)
            recording = self._box.recording(self._metadata)
            write_fault_report(folder, recording, self._box.fault)
            self.black_box = folder
            draw_fault_report(folder, recording, self._box.fault)
        except InputError as problem:
            self.black_box_problem = f"black box: {problem}"

    def add_notes(self, error: Exception) -> None:
        """Add to an exception of a tick where its data are, and what of them is missing."""
        error.add_note(
            f"The drives were stopped. Recording: {self._record}. Black box: {self.black_box}."
        )
        for text in filter(None, (self.outcome.problem, self.black_box_problem)):
            error.add_note(f"Not complete: {text}.")
