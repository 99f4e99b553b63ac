"""The stream of a trial and its readers: recording, estimates, progress line, live page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from estimation import Bank
from teleop.errors import InputError, reason
from teleop.files import FAULT_REPORT, unwritable
from teleop.recording.black_box import AFTER, BEFORE, write_black_box
from teleop.recording.recording import Recording, from_columns, reported_fault
from teleop.recording.recording_file import RecordingFile, recorded_ticks
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import Layout
from teleop.streams.stream import STORED, Stream
from teleop.trial.loop_verdict import LoopVerdict
from teleop.trial.metadata import session_metadata
from teleop.trial.readers import Outcome, Readers, ReadersInLoop, ReadersInProcesses
from teleop.trial.stop_switch import StopSwitch
from teleop.trial.viewer import Viewer

LONGER = 10.0
"""Time for which ticks are stored in addition to the duration of a trial, without a recording [s].
It contains the time before arming, and the end of the trial."""


class Outputs:
    """Creates the stream of a trial and its readers, closes them, and provides the ticks.

    The ticks are recorded to the file `record`, or else the ring has room for all ticks of the
    trial. The ring contains the ticks before and after a fault in any case.
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
        viewers: Sequence[Viewer] = (),
        checked: LoopVerdict | None = None,
    ) -> None:
        self._record = record
        self._metadata = session_metadata(settings, checked)
        self._start = 0
        self._before = round((BEFORE + AFTER) * settings.loop_rate) + 1
        in_loop = settings.clock == "virtual"
        stored = STORED if record else settings.duration + LONGER
        shared = not in_loop or bool(viewers)
        try:
            self.stream = Stream(layout, math.ceil(stored * settings.loop_rate), shared)
        except OSError as error:
            raise InputError(f"no memory for the ticks of the trial: {reason(error)}") from error
        target = settings.target
        recording: dict[str, Any] = {
            "path": str(record) if record else None,
            "metadata": self._metadata,
            "overwrite": overwrite,
            "duration": settings.duration,
            "show": show,
            "hint": switch.hint,
            "instructions": "" if switch.explained else switch.instructions,
            "cue": (target.depth, target.count_in) if target else None,
        }
        recorded = recording if record or show else None
        precision: dict[str, Any] | None = None
        if settings.until:
            precision = {
                "wanted": settings.until.text,
                "metadata": self._metadata,
                "duration": settings.duration,
            }
        self.readers: Readers
        try:
            if in_loop:
                self.readers = ReadersInLoop(self.stream, settings, bank, recorded, precision)
            else:
                self.readers = ReadersInProcesses(self.stream, settings, recorded, precision)
        except BaseException:
            self.stream.unlink()
            raise
        self.outcome = Outcome()
        self.black_box: Path | None = None
        """Folder with the ticks before and after a fault; None if none was written."""
        self.black_box_problem = ""
        """Reason why the black box could not be written."""

    @property
    def fault(self) -> dict[str, Any] | None:
        """Event of the fault that the trial reports."""
        return reported_fault(self.stream.events)

    def begin(self, start: int) -> None:
        """Begin to read. `start` is the expected time of the first tick, Unix time [ns]."""
        self._start = start
        self.readers.begin(start)

    def close(self) -> None:
        """End all readers."""
        try:
            self.outcome = self.readers.close()
        finally:
            self.stream.unlink()

    def ticks(self) -> Recording | RecordingFile:
        """Return all ticks; those in the ring if the file of the recording was lost."""
        recorded = recorded_ticks(self._record) if self._record and self.outcome.at_path else None
        return recorded or self._kept(1)

    def _kept(self, first: int) -> Recording:
        """Return the ticks from a number on that are in the ring."""
        stream = self.stream
        columns = stream.reader().columns(first, stream.newest + 1)
        return from_columns(stream.schema, columns, stream.events, self._metadata)

    def write_black_box(self) -> None:
        """Write the ticks around a fault, and its report, to a folder beside the recording."""
        if not (self._record and self.fault):
            return
        from teleop.output.fault_report import draw_fault_report, write_fault_report

        folder = self._record.with_suffix(FAULT_REPORT)
        kept = self._kept(self.stream.newest + 1 - self._before)
        columns = self.stream.schema.columns
        try:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise unwritable(folder, error) from error
            write_black_box(folder / "ticks.mcap", columns, kept, self._metadata, self._start)
            write_fault_report(folder, kept, self.fault)
            self.black_box = folder
            draw_fault_report(folder, kept, self.fault)
        except InputError as problem:
            self.black_box_problem = f"black box: {problem}"

    def add_notes(self, error: Exception) -> None:
        """Add to an exception of a tick where its data are, and what of them is missing."""
        error.add_note(
            f"The drives were stopped. Recording: {self._record}. Black box: {self.black_box}."
        )
        for text in filter(None, (self.outcome.problem, self.black_box_problem)):
            error.add_note(f"Not complete: {text}.")
