"""Run one trial, write its recording and its figures, and print its results."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from teleop.names import RealtimeName, WidthName

if TYPE_CHECKING:
    from teleop.settings.trial_settings import TrialSettings
    from teleop.trial.live_link import LiveLink
    from teleop.trial.result import Trial
    from teleop.trial.stop_switch import StopSwitch


@dataclass
class TrialRunner:
    """Runs trials, and writes the recording, the figures and the results of each trial."""

    record: Path | None
    """File of the recording; None for a new file in the folder recordings."""
    no_record: bool
    """Whether the trials are not recorded."""
    plot: Path | None
    """File of the figure of the estimates; None for no such figure."""
    plot_force: Path | None
    """File of the figure of the measured and the predicted force; None for no such figure."""
    plot_tracking: Path | None
    """File of the figure of the target and the position of the slave; None for no such figure."""
    width: WidthName
    """Width of the figures, for a screen or for a page."""
    overwrite: bool
    """Whether the figures overwrite existing files."""
    json: bool
    """Whether the results are printed as one JSON document instead of tables."""
    realtime: RealtimeName
    """Whether real-time settings, such as real-time scheduling, are required, tried or not used."""
    link: LiveLink | None = None
    """Connection to the live page, a web page that shows the trial; None without this page."""
    explained: bool = False
    """Whether a person was shown how to stop the trial before the drives were armed."""
    switch: StopSwitch | None = None
    """Means by which a person stops the latest trial; None before the first trial."""

    @property
    def interrupted(self) -> bool:
        """Whether a signal or the closing of the terminal ended the latest trial.

        It is also True if the signal arrived after the trial, while the results were written.
        """
        return self.switch is not None and self.switch.signalled

    def run(self, settings: TrialSettings) -> int:
        """Run a trial, and return the exit code.

        A trial with a live page (web page that shows the trial) can end before a person arms the
        drives, that is, permits them to move. If there is no fault and no signal such as Ctrl-C, no
        results are then printed, the recording is deleted, and the exit code is 0.

        Raises
        ------
        SafetyStop
            A fault stopped the trial.
        InputError
            The trial cannot be run, or an output cannot be written.
        RigError
            A device failed before the drives were armed.
        """
        from teleop.errors import InputError, SafetyStop
        from teleop.output import console
        from teleop.output.trial_tables import print_trial
        from teleop.printable import discard_output, print_error
        from teleop.recording.new_recording import new_recording
        from teleop.trial.run import run_trial
        from teleop.trial.stop_switch import StopSwitch

        record, reserved = self.record, None
        if not (record or self.no_record):
            palpated = settings.specimen or settings.cube
            record = reserved = new_recording(settings.condition_name, palpated)
        with StopSwitch(key=True, explained=self.explained) as switch:
            self.switch = switch
            try:
                trial = run_trial(
                    settings,
                    record,
                    sys.stderr.isatty(),
                    switch,
                    self.realtime if settings.clock == "real" else "off",
                    overwrite=bool(reserved),
                    live=self.link,
                    arm=True,  # `teleop run` has asked, or the live page asks
                )
            finally:
                if reserved and reserved.exists() and not reserved.stat().st_size:
                    reserved.unlink()
            if self.link:
                self.link.show_result(trial)
                if not (trial.armed or trial.fault or self.interrupted):
                    print_error(f"not armed: {switch.page.reason}")
                    if record:
                        record.unlink(missing_ok=True)
                    return 0
            problems = [trial.incomplete] if trial.incomplete else []
            self._draw(trial, problems)
            try:
                if self.json:
                    console.print_json(trial.summary())
                else:
                    print_trial(trial.summary())
            except OSError as error:
                if not (trial.fault or problems):
                    raise
                problems.append(discard_output(error))
        if trial.fault:
            for problem in problems:
                print_error(problem)
            raise SafetyStop(trial.stop_text)
        if problems:
            raise InputError("; ".join(problems))
        return 130 if trial.interrupted else 0

    def _draw(self, trial: Trial, problems: list[str]) -> None:
        """Draw the figures of a trial. If this fails, append the reason to the list `problems`.

        If the trial has no estimates, a message is printed instead.
        """
        from teleop.commands.figures import draw_trial
        from teleop.errors import InputError
        from teleop.printable import print_error

        pictures = (self.plot, self.plot_force, self.plot_tracking)
        drawn = [path for path in pictures if path]
        if drawn and len(trial.t):
            try:
                draw_trial(trial, *pictures, self.width, self.overwrite)
            except InputError as error:
                problems.append(str(error))
        elif drawn:
            print_error(f"{drawn[0]}: not drawn: there are no estimates")
