"""Statistics of a trial, computed in blocks of ticks, so that a long trial needs little memory."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from estimation import Bank
from estimation.presets import GATE
from teleop.evaluation.averages import RunningAverages
from teleop.evaluation.rendering import RunningHand, RunningRendering
from teleop.recording.recording import Recording
from teleop.recording.recording_file import RecordingFile
from teleop.recording.timing import RunningTiming
from teleop.safety.events import ACTIVE, STOPPING
from teleop.safety.soft_limits import ACCELERATION, FORCE, POSITION, VELOCITY
from teleop.trial.averaged import averaged_part
from teleop.trial.feedback_checks import arm_damping
from teleop.trial.settings import TrialSettings

LIMITS = {
    "velocity": VELOCITY,
    "acceleration": ACCELERATION,
    "position": POSITION,
    "force": FORCE,
}
"""Flag of each soft limit in the column `limited`, by the name of the limit."""


class TrialStatistics:
    """Statistics of a trial, which are part of `Trial.summary`.

    Parameters
    ----------
    ticks
        The ticks of the trial.
    settings
        Settings of the trial.
    bank
        The estimators in their final state.

    Attributes
    ----------
    ticks
        Number of ticks in mode active or stopping.
    pairs
        Number of ticks at which the estimators were updated.
    end
        Time of the last tick at which the estimators were updated [s]; NaN if there was none.
    depth
        Greatest absolute position of the slave at the ticks with updated estimators [m].
    contact_time
        Time in contact in the averaged part of the trial [s].
    limited
        Number of ticks at which each soft limit reduced the command, by the name of the limit.
    left_out
        Description of the samples outside the averaged part; empty if there are none.
    """

    def __init__(
        self, ticks: Recording | RecordingFile, settings: TrialSettings, bank: Bank
    ) -> None:
        self.ticks = self.pairs = 0
        self.end = math.nan
        self.depth = self.contact_time = 0.0
        self.limited = dict.fromkeys(LIMITS, 0)
        part = averaged_part(ticks, settings)
        self.left_out = part.left_out
        self._settings, self._recording = settings, ticks
        self._part = part
        self._threshold = (settings.estimation_preset.gate or GATE).force
        self._averages = RunningAverages(bank, part)
        self._contact = 0.0
        self._timing = RunningTiming()
        self._rendering = rendering_of(ticks, settings) if settings.has_link else None
        for block in ticks.blocks():
            self._add(block)

    def _add(self, block: Recording) -> None:
        """Add the next ticks."""
        self._timing.add(block)
        self.ticks += int(np.isin(block["mode"], (ACTIVE, STOPPING)).sum())
        flags = block["limited"].astype(int)
        for name, flag in LIMITS.items():
            self.limited[name] += int(((flags & flag) > 0).sum())
        if self._rendering:
            self._rendering.add(block.where(block["mode"] == ACTIVE))
        estimated = block.estimated()
        t, regression = estimated["time"], estimated.regression()
        self.pairs += len(t)
        if len(t):
            self.end = float(t[-1])
        self.depth = float(np.max(np.abs(estimated["slave_position"]), initial=self.depth))
        self._averages.begin(t, regression, estimated["excitation"])
        for name, estimates in estimated.estimates().items():
            self._averages.add(name, estimates, estimated.misfit(name))
        part = self._part.indices(t)
        touching = np.abs(regression.f[part]) > self._threshold
        self.contact_time += float(np.sum(regression.dt[part][touching]))
        if "contact" in estimated.columns:
            self._contact += float(np.sum(estimated["contact"][part]))
        else:
            self._contact = math.nan

    @property
    def contact(self) -> float:
        """Fraction of the samples in contact; NaN if there is no sample or no column `contact`."""
        return self._contact / self._averages.samples if self._averages.samples else math.nan

    @property
    def excitation(self) -> dict[str, float]:
        """Mean and last value of the excitation measure in the averaged part of the trial.

        Both are NaN if there is no sample in this part.
        """
        averages = self._averages
        return {"mean": averages.mean_excitation, "last": averages.last_excitation}

    @property
    def loop(self) -> dict[str, Any]:
        """Timing of the loop, see `RunningTiming.summary`."""
        return self._timing.summary(self._settings.rate)

    def estimates(self, shown: Recording) -> dict[str, Any]:
        """Return a summary of each estimator; empty if there is no sample.

        Parameters
        ----------
        shown
            Ticks of the trial: all ticks, or only some evenly spaced ticks.
        """
        if not self._averages.samples:
            return {}
        shown = shown.estimated()
        found = self._averages.summaries(shown["time"], shown.estimates())
        return {name: summary._asdict() for name, summary in found.items()}

    def feedback(self) -> dict[str, Any] | None:
        """Return a summary of the forces that the hand felt.

        The result is None if the trial has neither force feedback nor a channel.
        """
        if not self._rendering:
            return None
        settings = self._settings
        found = self._rendering.result(fault=self._recording.fault is not None)
        channel = settings.channel and settings.channel.text
        return {"law": settings.feedback.law, "channel": channel} | found._asdict()


def rendering_of(ticks: Recording | RecordingFile, settings: TrialSettings) -> RunningRendering:
    """Return an object that computes a summary of the forces that the hand felt."""
    end = 0.0
    for block in ticks.blocks(("time", "mode").__contains__):
        t = block["time"][block["mode"] == ACTIVE]
        end = float(t[-1]) if len(t) else end
    admittance, scale = settings.admittance, settings.coupling.scale
    hand = RunningHand(admittance.mass, admittance.damping, admittance.stiffness, scale)
    arm = None if settings.rig else partial(arm_damping, settings)
    return RunningRendering(hand, scale, settings.feedback.gain, end, arm)
