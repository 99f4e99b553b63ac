"""Define the result of a trial, with its recording, summary and figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from estimation import Bank, Estimates, Regression
from estimation.arrays import Floats
from estimation.presentation import Presented
from teleop.control.wanted_precision import REACHED
from teleop.errors import InputError
from teleop.recording.gaps import gap_rows, missing_text
from teleop.recording.recording import Recording
from teleop.recording.recording_file import RecordingFile
from teleop.recording.two_stations import connection_summary
from teleop.safety import Mode
from teleop.safety.events import EXCITATION, Fault, time_text
from teleop.settings.trial_settings import TrialSettings
from teleop.software import software
from teleop.streams.columns import OBSERVED
from teleop.trial.metadata import estimated_channels
from teleop.trial.precision import SOURCE as PRECISION
from teleop.trial.readers import Outcome
from teleop.trial.recorded_trial import recorded_truth, tracked_ticks, tracking_of, truth
from teleop.trial.trial_statistics import TrialStatistics

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from estimation.figures import Truth
    from teleop.trial.trial_result import TrialResult

LEAST_CONTACT = 1.0
"""Shortest contact time for which the summary of an interrupted trial contains estimates [s]."""


@dataclass(frozen=True, repr=False)
class Trial(Presented):
    """Result of a trial: its recording, summary, figures and tables."""

    settings: TrialSettings
    """Settings of the trial."""
    ticks: Recording | RecordingFile
    """All ticks of the trial, in memory or in the file of the recording; if this file is not
    complete, all ticks that can be read."""
    bank: Bank
    """The estimators of the trial. In real time, another process has updated its own ones."""
    interrupted: bool
    """Whether the trial ended early because of a signal such as Ctrl-C, a request of the live page,
    or the loss of the terminal."""
    outcome: Outcome
    """Path, number of missed ticks and problems of the recording file at the end."""
    realtime: dict[str, str]
    """Result of each real-time setting by name: `done`, or the reason why it was not applied."""
    fault: dict[str, Any] | None
    """Event of the reported fault: the first one, or that the slave moved after the stop. None if
    there was no fault."""
    rejected: dict[str, dict[str, int]]
    """Number of rejected CAN or serial frames, by device of the rig and reason."""
    black_box: Path | None
    """Folder with the ticks before and after a fault (black box); None if none was written."""
    black_box_problem: str = ""
    """Reason why the black box could not be written; empty if there was no such problem."""
    ending: str = ""
    """Reason why the condition ended the trial before its purpose was reached; empty if it was."""
    estimation_failure: str = ""
    """Text about an exception of an estimator, or the end of the process of the estimation; empty
    if there was none. The estimates are NaN from then on; `teleop estimate` computes them."""
    estimation_traceback: str = ""
    """Traceback of this exception."""
    missed: Mapping[str, int] = field(default_factory=dict)
    """Number of ticks that each process that reads the trial has missed, by its name."""

    @property
    def stop_text(self) -> str:
        """One line that states why the trial was stopped; empty if there was no fault.

        It also states if the drives did not confirm the stop, or if the slave moved after it.
        """
        if not self.fault:
            return ""
        faults = [event for event in self.ticks.events if event["fault"]] or [self.fault]
        grave = (Fault.MOVES_AFTER_STOP, Fault.NOT_STOPPED)
        texts = [faults[0]["text"]]
        texts += [event["text"] for event in faults[1:] if event["fault"] in grave]
        return f"stopped {time_text(self.since_armed(faults[0]))}: {'; '.join(texts)}"

    @property
    def precision(self) -> dict[str, Any] | None:
        """The wanted precision, whether it was reached, and the last statement about it.

        The keys are `wanted`, `reached` and `text`. None if the trial had the full duration.
        """
        wanted = self.settings.until
        if wanted is None:
            return None
        stated = [event["text"] for event in self.ticks.events if event.get("source") == PRECISION]
        text = stated[-1].removeprefix(f"{wanted.text}: ") if stated else "not evaluated"
        return {"wanted": wanted.parts, "reached": text.startswith(REACHED), "text": text}

    def since_armed(self, event: dict[str, Any]) -> float | None:
        """Return the time of an event since the drives were armed [s]; None if they were not."""
        return float(event["time"] - self.armed["time"]) if self.armed else None

    @cached_property
    def recording(self) -> Recording:
        """All ticks of the trial, in memory.

        The ticks of a long recorded trial are not in memory at first. They are read from the file
        of the recording when this property is first used.

        Raises
        ------
        InputError
            The file cannot be read, or the recording is too large for the memory of this machine.
        """
        return self.ticks.load()

    @cached_property
    def statistics(self) -> TrialStatistics:
        """Statistics of all ticks of the trial, from which `summary` is computed."""
        return TrialStatistics(self.ticks, self.settings, self.bank)

    @cached_property
    def result(self) -> TrialResult:
        """Stiffness and damping for publication, computed from all samples after the trial.

        `result.summary` is a dictionary with the parts `result`, `best_model`, `models` and
        `transmission` of the document that `teleop estimate --json` prints for the recording. In
        `result.summary["result"]`, k and b are None if the data are not sufficient, and `reasons`
        states why. The trial is evaluated when this property is first used.
        """
        # scipy is imported here, after the trial, because this takes long
        from teleop.trial.trial_result import trial_result, without

        if not self.statistics.pairs:
            ended = "the trial ended before its first sample"
            at_slave = "the slave station measures and estimates them: see teleop merge"
            return without(ended if self.settings.has_slave else at_slave)
        complete = self.outcome.path and not self.outcome.problem
        return trial_result(self.ticks, self.outcome.path if complete else None)

    @cached_property
    def shown(self) -> Trial:
        """A copy of this trial for figures and short texts.

        If the ticks are not in memory, the copy contains only some of them, evenly spaced in time.
        """
        return replace(self, ticks=self.ticks.evenly_spaced())

    @property
    def columns(self) -> dict[str, Floats]:
        """Recorded columns by name, at the n ticks at which the estimators were updated.

        Each column has the shape (n,).
        """
        return self.recording.estimated().columns

    @property
    def estimates(self) -> dict[str, Estimates]:
        """Estimates of stiffness and damping after each update, by the name of the estimator."""
        return self.recording.estimated().estimates()

    @property
    def t(self) -> Floats:
        """Times at which the estimators were updated [s], shape (n,) for n updates."""
        return self.recording.estimated()["time"]

    @property
    def regression(self) -> Regression:
        """The samples of displacement, velocity and force that the estimators received."""
        return self.recording.estimated().regression()

    @property
    def about(self) -> str:
        """Short description: condition, palpated body, and duration."""
        settings = self.settings
        return f"{settings.condition_name}, {settings.palpated}, {settings.duration:g} s"

    @property
    def armed(self) -> dict[str, Any] | None:
        """Event at which the drives were armed; None if they were not armed."""
        return next((e for e in self.ticks.events if e["mode"] == "active"), None)

    @property
    def without_estimates(self) -> str:
        """Text that states why estimates are missing, and what computes them; else empty."""
        if not self.estimation_failure:
            return ""
        path = self.outcome.path
        where = f"teleop estimate {path}" if path else "teleop estimate, from a recording,"
        return f"the estimates are not complete: {self.estimation_failure}; {where} computes them"

    @property
    def incomplete(self) -> str:
        """Text that states which data are missing in the files of the trial; empty if none are."""
        path, dropped, problem, _ = self.outcome
        problems = []
        if problem:
            problems.append(f"{path}: the recording is not complete: {problem}")
        elif dropped and path:
            missing = missing_text(self.ticks.gaps) or f"{dropped} ticks are missing"
            problems.append(f"{path}: {missing}")
        if self.black_box_problem:
            problems.append(self.black_box_problem)
        return "; ".join(problems)

    def plot(
        self, width: str = "screen", title: str | None = None, truth: Truth | None = None
    ) -> Figure:
        """Return a figure of the estimated stiffness and damping, and of the motion, over time.

        k and b of `result` are drawn as horizontal lines with their 95 % intervals.

        Parameters
        ----------
        width
            Name of the width of the figure: `screen`, `a4`, `single` (one column of an IEEE paper)
            or `double` (two columns).
        title
            Title of the figure. Default: condition, palpated body, and k and b of `result`.
        truth
            True stiffness and damping to show. Default: those of the body on the simulated rig.
        """
        from estimation.figure_style import figure_style
        from estimation.figures import estimates_figure, known_truth, misfit_remark
        from teleop.output.fit_figures import drawn_result, result_title

        found = self.result.summary["result"]
        true = truth or known_truth(recorded_truth(self.shown.recording))
        rows = self.summary()["estimates"].items()
        remark = misfit_remark({name: row["misfit"] for name, row in rows})
        shown = self.shown
        x, v, *_ = shown.regression
        with figure_style(width):
            return estimates_figure(
                result_title(self._title(None), found) if title is None else title,
                shown.t,
                x,
                v,
                shown.estimates,
                true,
                drawn_result(found),
                remark,
            )

    def plot_force(self, width: str = "screen", title: str | None = None) -> Figure:
        """Return a figure of the measured force and the force that the first estimator predicts.

        Parameters
        ----------
        width, title
            As in `plot`.
        """
        return Presented.plot_force(self.shown, width, self._title(title))

    def plot_tracking(self, width: str = "screen", title: str | None = None) -> Figure:
        """Return a figure of target, slave position and their difference in the condition `mimic`.

        For a long trial, the figure shows only the last ticks.

        Parameters
        ----------
        width, title
            As in `plot`.

        Raises
        ------
        InputError
            The condition is not `mimic`, or the target moved for too few periods, see `tracking`.
        """
        from estimation.figure_style import figure_style
        from teleop.output.trial_figures import tracking_figure

        ticks = tracked_ticks(self.ticks)
        found = tracking_of(ticks, self.settings)
        if found is None:
            raise InputError(
                f"no tracking in a trial of {self.settings.condition_name} and "
                f"{self.settings.duration:g} s: expected mimic and two periods of the target"
            )
        with figure_style(width):
            return tracking_figure(self._title(title), ticks, found._asdict())

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the recorded columns as a pandas table, whose index is the time [s].

        The table has one row for each tick at which the estimators were updated.

        Raises
        ------
        ImportError
            pandas is not installed.
        """
        return self.recording.estimated().to_dataframe()

    def __repr__(self) -> str:
        """Return one line of text with the estimates after the last sample."""
        return Presented.__repr__(self.shown)

    def _repr_html_(self) -> str:
        return Presented._repr_html_(self.shown)

    def _title(self, title: str | None) -> str:
        from teleop.output.figure_files import plain

        return (
            plain(f"{self.settings.condition_name}, {self.settings.palpated}")
            if title is None
            else title
        )

    def tracking(self) -> dict[str, Any] | None:
        """Return numbers that describe how well the slave followed the target in `mimic`.

        The dictionary has the keys of `Tracking`, such as `gain` and `phase_deg`. It is computed
        from the last ticks if the trial is long. The result is None if the condition is not `mimic`
        or if the target moved for too few periods (`FEWEST` in
        `teleop.evaluation.teleoperation.tracking`).
        """
        found = tracking_of(tracked_ticks(self.ticks), self.settings)
        return found and found._asdict()

    def feedback(self) -> dict[str, Any] | None:
        """Return the stiffness, force error and energy that the hand felt, see `Rendering`.

        The result is None if the trial had neither force feedback nor a communication channel
        between master and slave, or if one side of it was at another computer.
        """
        if not (self.settings.has_master and self.settings.has_slave):
            return None
        return self.statistics.feedback()

    def observer(self) -> dict[str, float] | None:
        """Return how the observed force of the hand differs from that of the coupling.

        The result is None if no observer estimates the force of the hand. Both forces are compared
        while the drives are active.
        """
        recording = self.shown.recording
        if OBSERVED not in recording.columns or self.settings.hand_observer is None:
            return None
        part = (recording["mode"] == Mode.ACTIVE) & np.isfinite(recording[OBSERVED])
        if not np.any(part):
            return None
        coupled = recording["master_force"][part]
        difference = float(np.sqrt(np.mean((recording[OBSERVED][part] - coupled) ** 2)))
        return {
            "rms_difference_n": difference,
            "rms_coupling_n": float(np.sqrt(np.mean(coupled**2))),
        }

    def station(self) -> dict[str, Any] | None:
        """Return what a station has measured of its connection; None on one computer."""
        if not self.settings.station:
            return None
        side = self.settings.station.side
        return {"side": side, **connection_summary(self.ticks)}

    def summary(self) -> dict[str, Any]:
        """Return the results of the trial as a dictionary, which `teleop run --json` prints."""
        settings, found = self.settings, self.statistics
        corrected = settings.online_transmission
        return {
            "condition": settings.condition_name,
            "cube": settings.cube if settings.is_simulated else None,
            "specimen": settings.palpated,
            "operator": settings.operator,
            "notes": settings.notes,
            "rig": settings.rig_name,
            "software": f"teleop {software()}",
            "hand_force": settings.hand_force_source,
            "observer": self.observer(),
            "estimated_channels": list(estimated_channels(settings)),
            "duration_s": settings.duration,
            "until": self.precision,
            "choices": [
                {"time_s": self.since_armed(event), "text": event["text"]}
                for event in self.ticks.events
                if event.get("source") == EXCITATION
            ],
            "actual_duration_s": found.end - (self.armed or {"time": 0.0})["time"]
            if found.pairs or (self.armed and not settings.has_slave)
            else 0.0,
            "contact_s": found.contact_time,
            "least_contact_s": LEAST_CONTACT,
            "clock": settings.clock,
            "seed": settings.seed,
            "ticks": found.ticks,
            "pairs": found.pairs,
            "station": self.station(),
            "rejected": self.rejected,
            "interrupted": self.interrupted,
            "ending": self.ending or None,
            "estimation_failure": self.estimation_failure or None,
            "missed": {name: count for name, count in self.missed.items() if count},
            "tracking": self.tracking(),
            "feedback": self.feedback(),
            "estimates": found.estimates(self.shown.recording)
            if found.contact_time >= LEAST_CONTACT or not self.interrupted
            else {},
            "truth": truth(settings, found.depth) if settings.is_simulated else None,
            "left_out": found.left_out,
            "force_lag_s": corrected.force_lag,
            "lost_motion_m": corrected.lost_motion,
            "expected_intervals": found.expected,
            "contact": found.contact,
            "loop": found.loop,
            "safety": {
                "fault": self.fault,
                "fault_s": self.since_armed(self.fault) if self.fault else None,
                "further_faults": [
                    event["text"]
                    for event in self.ticks.events
                    if event["fault"] and event["text"] != (self.fault or {}).get("text")
                ],
                "limited_ticks": found.limited,
            },
            "realtime": self.realtime,
            "recording": {
                "path": str(self.outcome.path) if self.outcome.path else None,
                "complete": not (self.outcome.problem or self.outcome.dropped),
                "problem": self.outcome.problem or None,
                "recoverable": bool(self.outcome.problem) and self.outcome.at_path,
                "dropped": self.outcome.dropped,
                "missing_ticks": gap_rows(self.ticks.gaps),
                "black_box": str(self.black_box) if self.black_box else None,
                "black_box_problem": self.black_box_problem or None,
            },
        }
