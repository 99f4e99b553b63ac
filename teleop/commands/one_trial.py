"""Run one trial, write its recording and its figures, and print its results."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from teleop.commands.options import OUTPUT, Json, Overwrite, Width
from teleop.names import RealtimeName

if TYPE_CHECKING:
    from teleop.settings.trial_settings import TrialSettings
    from teleop.trial.live_link import LiveLink
    from teleop.trial.result import Trial
    from teleop.trial.station_waiting import Waiting
    from teleop.trial.stop_switch import StopSwitch


@dataclass(frozen=True)
class OutputOptions:
    """Options of the files that are written for a trial, and of the printed results."""

    record: Path | None = None
    """Record every tick to this MCAP file; its folder is created if needed. Default: a new file
    recordings/DATE/TIME-CONDITION-SPECIMEN.mcap."""
    no_record: bool = False
    """Do not record."""
    details: bool = False
    """Also print averages of the estimators, true values, expected intervals, and loop timing."""
    plot: Path | None = None
    """Plot the estimates to this .png, .svg or .pdf file."""
    plot_force: Path | None = None
    """Plot the measured and the predicted force to this .png, .svg or .pdf file."""
    plot_tracking: Path | None = None
    """In mimic, plot the target, the position of the slave, and the difference between them, to
    this .png, .svg or .pdf file."""
    width: Width = "screen"
    overwrite: Overwrite = False
    json: Json = False

    @property
    def pictures(self) -> tuple[Path | None, ...]:
        """The figures to be drawn, in the order of `draw`."""
        return self.plot, self.plot_force, self.plot_tracking

    @property
    def is_for_one_trial(self) -> bool:
        """Whether a named file is written, which a second trial would overwrite."""
        return bool(self.record or any(self.pictures))

    def check(self, settings: TrialSettings, sources: tuple[Path | None, ...]) -> None:
        """Check the files to be written, and create the folder of the recording.

        `sources` are the files that are read, which must not be overwritten.
        """
        from teleop.control.conditions import CONDITIONS
        from teleop.errors import InputError
        from teleop.files import RECORDING, check_ending, check_outputs, make_folder

        if self.record and self.no_record:
            raise InputError("--record and --no-record: expected at most one of them")
        if self.record:
            check_ending(self.record, RECORDING)
            make_folder(self.record)
        if self.plot_tracking and not settings.target:
            motion = settings.intended_motion
            followed = [name for name, one in CONDITIONS.items() if one().target_for(motion)]
            raise InputError(
                f"--plot-tracking: expected --condition {' or '.join(followed)}, in which there is "
                "a target"
            )
        check_outputs(
            self.record, pictures=self.pictures, sources=sources, overwrite=self.overwrite
        )

    def draw(self, trial: Trial) -> None:
        """Draw the requested figures of a trial; InputError if a file cannot be written."""
        from teleop.output.figure_files import save

        figures = (trial.plot, trial.plot_force, trial.plot_tracking)
        for figure, path in zip(figures, self.pictures, strict=True):
            if path:
                save(figure(self.width), path, self.overwrite)


Output = Annotated[OutputOptions, Parameter(name="*", group=OUTPUT)]
TABLES = OutputOptions()


@dataclass
class TrialRunner:
    """Runs trials, and writes the recording, the figures and the results of each trial."""

    output: OutputOptions
    realtime: RealtimeName
    link: LiveLink | None = None
    explained: bool = False
    """Whether a person has been told how to stop the trial."""
    station: Waiting | None = None
    """Session with the other station; None on one computer."""
    switch: StopSwitch | None = None
    """Means to stop the latest trial; None before the first trial."""

    @property
    def interrupted(self) -> bool:
        """Whether a signal ended the latest trial, or arrived while its results were written."""
        return self.switch is not None and self.switch.signalled

    def run(self, settings: TrialSettings) -> int:
        """Run a trial, and return the exit code; SafetyStop if a fault stopped the trial."""
        from teleop.errors import InputError, SafetyStop
        from teleop.printable import print_error
        from teleop.trial.stop_switch import StopSwitch

        with StopSwitch(key=True, explained=self.explained) as switch:
            self.switch = switch
            trial, record = self._performed(settings, switch)
            if self.link:
                self.link.show_result(trial)
                if not (trial.armed or trial.fault or self.interrupted):  # nobody started it
                    print_error(f"not armed: {switch.page.reason}")
                    if record:
                        record.unlink(missing_ok=True)
                    return 0
            problems = [
                text for text in (trial.ending, trial.incomplete, trial.without_estimates) if text
            ]
            if trial.estimation_traceback:  # this defect would end the evaluation, too
                sys.stderr.write(trial.estimation_traceback)
            else:
                self._draw(trial, problems)
                self._print(trial, problems)
        if trial.fault:
            for problem in problems:
                print_error(problem)
            raise SafetyStop(trial.stop_text)
        if trial.estimation_traceback:
            print_error("; ".join(problems))
            return 1
        if problems:
            raise InputError("; ".join(problems))
        return 130 if trial.interrupted else 0

    def _performed(self, settings: TrialSettings, switch: StopSwitch) -> tuple[Trial, Path | None]:
        """Run a trial; return it with the file of its recording."""
        from teleop.recording.new_recording import new_recording
        from teleop.trial.run import run_trial

        record, reserved = self.output.record, None
        if not (record or self.output.no_record):
            palpated = settings.specimen or settings.cube
            record = reserved = new_recording(settings.condition_name, palpated)
        try:
            trial = run_trial(
                settings,
                record,
                sys.stderr.isatty(),
                switch,
                self.realtime if settings.clock == "real" else "off",
                overwrite=bool(reserved),
                live=self.link,
                station=self.station,
                arm=True,  # `teleop run` has asked, or the live page asks
            )
        finally:
            if reserved and reserved.exists() and not reserved.stat().st_size:
                reserved.unlink()  # the trial did not begin
        return trial, record

    # A problem with an output must not hide the fault of a trial: it is appended to `problems`.

    def _draw(self, trial: Trial, problems: list[str]) -> None:
        """Draw the figures of a trial."""
        from teleop.errors import InputError
        from teleop.printable import print_error

        drawn = [path for path in self.output.pictures if path]
        if drawn and len(trial.t):
            try:
                self.output.draw(trial)
            except InputError as error:
                problems.append(str(error))
        elif drawn:
            print_error(f"{drawn[0]}: not drawn: there are no estimates")

    def _print(self, trial: Trial, problems: list[str]) -> None:
        """Print the results of a trial."""
        from teleop.output.console import print_json
        from teleop.output.trial_tables import print_trial
        from teleop.printable import discard_output

        try:
            summary = {
                **trial.summary(),
                **trial.result.summary,
                "true_result": trial.result.true,
            }
            if self.output.json:
                print_json(summary)
            else:
                print_trial(summary, self.output.details)
        except OSError as error:
            if not (trial.fault or problems):
                raise
            problems.append(discard_output(error))
