"""The result of a trial: its recording and its summary."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from estimation import Bank, Estimates
from estimation.compiled import Floats
from estimation.presets import GATE
from estimation.summary import summarise
from teleop.errors import InputError
from teleop.evaluation.tracking import tracking
from teleop.recording.gaps import gap_rows, missing_text
from teleop.recording.recording import Recording
from teleop.recording.sinks import Outcome
from teleop.recording.timing import loop_timing, tick_times
from teleop.safety.events import ACTIVE, STOPPING
from teleop.safety.soft_limits import ACCELERATION, FORCE, POSITION, VELOCITY
from teleop.trial.metadata import estimated_channels
from teleop.trial.settings import TrialSettings
from teleop.trial.settings_json import from_document

LEAST_CONTACT = 1.0
"""Shortest time in contact for which the summary of an interrupted trial has estimates [s]."""


@dataclass(frozen=True)
class Trial:
    """Result of a trial."""

    settings: TrialSettings
    """Settings of the trial."""
    recording: Recording
    """All ticks of the trial. If the file is not complete, the intact ticks."""
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
    """Number of frames that each device of the rig rejected, by reason."""
    black_box: Path | None
    """Folder of the black box; None if there was no fault."""
    black_box_problem: str = ""
    """Reason why the black box could not be written; empty if it was, or if there was no fault."""

    @property
    def columns(self) -> dict[str, Floats]:
        """Columns of the ticks at which the estimators were updated, each of shape (ticks,)."""
        return self.recording.estimated().columns

    @property
    def estimates(self) -> dict[str, Estimates]:
        """Estimates at these ticks, by the name of the estimator."""
        return self.recording.estimated().estimates()

    @property
    def armed(self) -> dict[str, Any] | None:
        """Event of the arming of the drives; None if they were not armed."""
        return next((e for e in self.recording.events if e["mode"] == "active"), None)

    @property
    def incomplete(self) -> str:
        """Text that states which data are missing in the files of the trial; empty for none."""
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

    def tracking(self) -> dict[str, Any] | None:
        """Return gain, phase and error of the slave relative to the target of mimic.

        None if the condition is not mimic, or if the target moved for less than two periods.
        """
        if self.settings.condition != "mimic":
            return None
        t, target, position = (self.recording[n] for n in ("time", "target", "slave_position"))
        found = tracking(t, target, position, self.settings.target.frequency)
        return found and found._asdict()

    def summary(self) -> dict[str, Any]:
        """Return the results of the trial, in the form of `teleop run --json`."""
        settings, active = self.settings, self.recording.estimated()
        t, regression = active["time"], active.regression()
        if len(t):
            depth = float(np.max(np.abs(active["slave_position"])))
            excitation = float(np.mean(active["excitation"])), float(active["excitation"][-1])
        else:
            depth, excitation = 0.0, (math.nan, math.nan)
        whole, in_contact = self.recording, active.columns.get("contact", np.array([]))
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
            "actual_duration_s": float(t[-1] - (self.armed or {"time": 0.0})["time"])
            if len(t)
            else 0.0,
            "contact_s": contact,
            "least_contact_s": LEAST_CONTACT,
            "clock": settings.clock,
            "seed": settings.seed,
            "ticks": int(np.isin(self.recording["mode"], (ACTIVE, STOPPING)).sum()),
            "pairs": len(t),
            "rejected": self.rejected,
            "interrupted": self.interrupted,
            "tracking": self.tracking(),
            "estimates": {
                name: summarise(
                    t, regression, estimates, self.bank[name], active.misfit(name)
                )._asdict()
                for name, estimates in active.estimates().items()
                if len(t) and (contact >= LEAST_CONTACT or not self.interrupted)
            },
            "truth": None if settings.rig else truth(settings, depth),
            "excitation": {"mean": excitation[0], "last": excitation[1]},
            "contact": float(np.mean(in_contact)) if len(in_contact) else math.nan,
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


def truth(settings: TrialSettings, depth: float) -> dict[str, float]:
    """Return the true damping, stiffness, lag and lost motion of the simulated rig.

    The stiffness is that of the cube and the transmission in series, because the encoder measures
    the position before the transmission.

    Parameters
    ----------
    settings
        Settings of the trial.
    depth
        Greatest displacement in the trial [m], for the stiffness at this depth.
    """
    setup = settings.setup
    cube, transmission = setup.cube, setup.transmission
    return {
        "b": cube.b,
        "k_surface": cube.k1 / (1.0 + transmission.compliance * cube.k1),
        "k_deepest": setup.force(depth) / depth if depth else cube.k1,
        "force_lag_s": setup.force_lag,
        "lost_motion_m": transmission.lost_motion,
    }


def recorded_truth(recording: Recording) -> dict[str, float] | None:
    """Return the true values of a recorded trial on the simulated rig; None for other rigs."""
    if not recording.settings or recording.session.get("rig") != "simulated":
        return None
    try:
        settings = from_document(recording.settings)
    except InputError:
        return None
    return truth(settings, float(np.max(np.abs(recording["slave_position"]), initial=0.0)))


def safety_summary(active: Recording, fault: dict[str, Any] | None) -> dict[str, Any]:
    """Return the first fault, the texts of further faults, and the effect of the soft limits.

    The effect of a soft limit is the number of ticks at which it reduced the command.

    Parameters
    ----------
    active
        Ticks at which the estimators were updated.
    fault
        Event of the first fault; None for none.
    """
    flags = active["limited"].astype(int)
    names = {"velocity": VELOCITY, "acceleration": ACCELERATION, "position": POSITION}
    held = {
        name: int(((flags & flag) > 0).sum()) for name, flag in (names | {"force": FORCE}).items()
    }
    further = [event["text"] for event in active.events if event["fault"]][1:]
    return {"fault": fault, "further_faults": further, "limited_ticks": held}
