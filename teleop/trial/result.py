"""Define the result of a trial, with its recording, summary and figures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from estimation import Bank, Estimates, Regression
from estimation.compiled import Floats
from estimation.presentation import Presented
from estimation.presets import GATE
from estimation.summary import summarise
from teleop.errors import InputError
from teleop.evaluation.rendering import rendering
from teleop.recording.gaps import gap_rows, missing_text
from teleop.recording.recording import Recording
from teleop.recording.sinks import Outcome
from teleop.recording.timing import loop_timing, tick_times
from teleop.safety.events import ACTIVE, STOPPING
from teleop.safety.soft_limits import ACCELERATION, FORCE, POSITION, VELOCITY
from teleop.trial.averaged import averaged_part
from teleop.trial.metadata import estimated_channels
from teleop.trial.settings import TrialSettings
from teleop.trial.tracked import tracking_of
from teleop.trial.true_values import recorded_truth, truth

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from estimation.figures import Truth

LEAST_CONTACT = 1.0
"""Shortest contact time for which the summary of an interrupted trial contains estimates [s]."""


@dataclass(frozen=True, repr=False)
class Trial(Presented):
    """Result of a trial."""

    settings: TrialSettings
    """Settings of the trial."""
    recording: Recording
    """All ticks of the trial; if the recording file is not complete, all ticks that can be read."""
    bank: Bank
    """The estimators in their final state."""
    interrupted: bool
    """Whether a person ended the trial before its full duration."""
    outcome: Outcome
    """Path, number of ticks and problems of the recording file at the end."""
    realtime: dict[str, str]
    """Result of each step of the real-time settings."""
    fault: dict[str, Any] | None
    """Event of the first fault; None if there was no fault."""
    rejected: dict[str, dict[str, int]]
    """Number of rejected CAN or serial frames, by device of the rig and reason."""
    black_box: Path | None
    """Folder of the black box; None if there was no fault."""
    black_box_problem: str = ""
    """Reason why the black box could not be written; empty if there was no such problem."""

    @property
    def columns(self) -> dict[str, Floats]:
        """Recorded columns at the ticks with updated estimators, each of shape (ticks,)."""
        return self.recording.estimated().columns

    @property
    def estimates(self) -> dict[str, Estimates]:
        """Estimates at the ticks with updated estimators, by the name of the estimator."""
        return self.recording.estimated().estimates()

    @property
    def t(self) -> Floats:
        """Time of each tick with updated estimators [s], shape (ticks,)."""
        return self.recording.estimated()["time"]

    @property
    def regression(self) -> Regression:
        """The samples that the estimators received."""
        return self.recording.estimated().regression()

    @property
    def about(self) -> str:
        """Short description: condition, palpated body, and duration."""
        settings = self.settings
        return f"{settings.condition}, {settings.palpated}, {settings.duration:g} s"

    @property
    def armed(self) -> dict[str, Any] | None:
        """Event at which the drives were armed; None if they were not armed."""
        return next((e for e in self.recording.events if e["mode"] == "active"), None)

    @property
    def incomplete(self) -> str:
        """Description of data that are missing in the files of the trial; empty if none are."""
        path, _, dropped, problem, _ = self.outcome
        problems = []
        if problem:
            problems.append(f"{path}: the recording is not complete: {problem}")
        elif dropped and path:
            missing = missing_text(self.recording.gaps) or f"{dropped} ticks are missing"
            problems.append(f"{path}: {missing}")
        if self.black_box_problem:
            problems.append(self.black_box_problem)
        return "; ".join(problems)

    def plot(
        self, width: str = "screen", title: str | None = None, truth: Truth | None = None
    ) -> Figure:
        """Return a figure over time: stiffness and damping with 95 % intervals, and motion.

        Parameters
        ----------
        width
            `screen`; `single` or `double` for one or two columns of an IEEE paper; or `a4`.
        title
            Title of the figure. Default: condition and palpated body.
        truth
            True values to show. Default: those of the simulated rig.
        """
        from estimation.figures import known_truth

        return super().plot(
            width, self._title(title), truth or known_truth(recorded_truth(self.recording))
        )

    def plot_force(self, width: str = "screen", title: str | None = None) -> Figure:
        """Return a figure of the measured force and the force that the first estimator predicts.

        Parameters
        ----------
        width, title
            As in `plot`.
        """
        return super().plot_force(width, self._title(title))

    def plot_tracking(self, width: str = "screen", title: str | None = None) -> Figure:
        """Return a figure of target, slave position and their difference in the condition `mimic`.

        Parameters
        ----------
        width, title
            As in `plot`.

        Raises
        ------
        InputError
            The condition is not `mimic`, or the target moved for less than two periods.
        """
        from estimation.figure_style import figure_style
        from teleop.output.tracking_figure import tracking_figure

        found = self.tracking()
        if found is None:
            raise InputError(
                f"no tracking in a trial of {self.settings.condition} and "
                f"{self.settings.duration:g} s: expected mimic and two periods of the target"
            )
        with figure_style(width):
            return tracking_figure(self._title(title), self.recording, found)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return all recorded columns at the ticks with updated estimators, indexed by time [s].

        Raises
        ------
        ImportError
            pandas is not installed.
        """
        return self.recording.estimated().to_dataframe()

    def _title(self, title: str | None) -> str:
        from teleop.output.figure_files import plain

        return (
            plain(f"{self.settings.condition}, {self.settings.palpated}")
            if title is None
            else title
        )

    def tracking(self) -> dict[str, Any] | None:
        """Return gain, phase and error of the slave relative to the target in `mimic`.

        The result is None if the condition is not `mimic`, or if the target moved for less than two
        periods.
        """
        found = tracking_of(self.recording, self.settings)
        return found and found._asdict()

    def feedback(self) -> dict[str, Any] | None:
        """Return a summary of the displayed forces; None without force feedback and channel."""
        settings = self.settings
        if not settings.has_link:
            return None
        admittance, feedback = settings.admittance, settings.feedback
        found = rendering(
            self.recording.where(self.recording["mode"] == ACTIVE),
            admittance.mass,
            admittance.damping,
            admittance.stiffness,
            settings.coupling.scale,
            feedback.gain,
        )
        channel = settings.channel and settings.channel.text
        return {"law": feedback.law, "channel": channel} | found._asdict()

    def summary(self) -> dict[str, Any]:
        """Return the results of the trial, with the keys of the output of `teleop run --json`."""
        settings, active = self.settings, self.recording.estimated()
        depth = float(np.max(np.abs(active["slave_position"]), initial=0.0))
        part = averaged_part(self.recording, settings)
        averaged = active.where(part.contains(active["time"]))
        t, regression, excitation = averaged["time"], averaged.regression(), averaged["excitation"]
        whole = self.recording
        threshold = (settings.estimation_preset.gate or GATE).force
        contact = float(np.sum(regression.dt[np.abs(regression.f) > threshold]))
        return {
            "condition": settings.condition,
            "cube": None if settings.rig else settings.cube,
            "specimen": settings.palpated,
            "operator": settings.operator,
            "notes": settings.notes,
            "rig": settings.rig_name,
            "estimated_channels": list(estimated_channels(settings)),
            "duration_s": settings.duration,
            "actual_duration_s": float(active["time"][-1] - (self.armed or {"time": 0.0})["time"])
            if len(active)
            else 0.0,
            "contact_s": contact,
            "least_contact_s": LEAST_CONTACT,
            "clock": settings.clock,
            "seed": settings.seed,
            "ticks": int(np.isin(self.recording["mode"], (ACTIVE, STOPPING)).sum()),
            "pairs": len(active),
            "rejected": self.rejected,
            "interrupted": self.interrupted,
            "tracking": self.tracking(),
            "feedback": self.feedback(),
            "estimates": {
                name: summarise(
                    t, regression, estimates, self.bank[name], averaged.misfit(name)
                )._asdict()
                for name, estimates in averaged.estimates().items()
                if len(t) and (contact >= LEAST_CONTACT or not self.interrupted)
            },
            "truth": None if settings.rig else truth(settings, depth),
            "left_out": part.left_out,
            "excitation": {"mean": average(excitation), "last": average(excitation[-1:])},
            "contact": average(averaged.columns.get("contact", np.array([]))),
            "loop": loop_timing(settings.rate, whole["dt"], whole["lateness"], whole["overrun"])
            | tick_times(whole),
            "safety": safety_summary(active, self.fault),
            "realtime": self.realtime,
            "recording": {
                "path": str(self.outcome.path) if self.outcome.path else None,
                "complete": not (self.outcome.problem or self.outcome.dropped),
                "problem": self.outcome.problem or None,
                "recoverable": bool(self.outcome.problem) and self.outcome.at_path,
                "dropped": self.outcome.dropped,
                "missing_ticks": gap_rows(whole.gaps),
                "black_box": str(self.black_box) if self.black_box else None,
                "black_box_problem": self.black_box_problem or None,
            },
        }


def average(values: Floats) -> float:
    """Return the mean of values, shape (n,); NaN if there are none."""
    return float(np.mean(values)) if len(values) else math.nan


def safety_summary(active: Recording, fault: dict[str, Any] | None) -> dict[str, Any]:
    """Return the first fault, the texts of further faults, and counts for the soft limits.

    The count of a soft limit is the number of ticks at which it reduced the command.

    Parameters
    ----------
    active
        Ticks at which the estimators were updated.
    fault
        Event of the first fault; None if there was no fault.
    """
    flags = active["limited"].astype(int)
    names = {"velocity": VELOCITY, "acceleration": ACCELERATION, "position": POSITION}
    held = {
        name: int(((flags & flag) > 0).sum()) for name, flag in (names | {"force": FORCE}).items()
    }
    further = [event["text"] for event in active.events if event["fault"]][1:]
    return {"fault": fault, "further_faults": further, "limited_ticks": held}
