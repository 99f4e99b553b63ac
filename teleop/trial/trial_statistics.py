"""Statistics of a trial, computed in blocks of ticks, so that a long trial needs little memory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from estimation import Bank
from estimation.presets import GATE
from teleop.control.feedback.law import STIFF_PRIOR, MasterHalf
from teleop.control.feedback.settings import LAWS
from teleop.evaluation.online.averages import RunningAverages
from teleop.evaluation.teleoperation.rendering import Rendering, RunningHand, RunningRendering
from teleop.recording.recording import Recording
from teleop.recording.recording_file import RecordingFile
from teleop.recording.timing import RunningTiming
from teleop.safety import Fault
from teleop.safety.events import ACTIVE, STOPPING
from teleop.safety.soft_limits import FLAGS
from teleop.settings.feedback_checks import arm_damping
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.recorded_trial import averaged_part, trial_settings


class TrialStatistics:
    """Statistics of a trial, which are part of `Trial.summary`.

    The averaged part is the part of the trial over which the estimates are averaged
    (`averaged_part`). It does not include the count-in of `mimic` (the time before the target
    starts to move) and the end of `autonomous`, where the excitation decreases to zero.

    Attributes
    ----------
    ticks
        Number of ticks at which the safety supervisor was in the mode active or stopping.
    pairs
        Number of ticks with a pair of slave position and contact force, for the estimators.
    end
        Time of the last tick with such a pair [s]; NaN if there was none.
    depth
        Greatest magnitude of the slave position at the ticks with such a pair [m].
    contact_time
        Time in the averaged part during which the slave touched the specimen [s].
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
        self.limited = dict.fromkeys(FLAGS, 0)
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
        """Add a block of successive ticks to the statistics."""
        self._timing.add(block)
        self.ticks += int(np.isin(block["mode"], (ACTIVE, STOPPING)).sum())
        flags = block["limited"].astype(int)
        for name, flag in FLAGS.items():
            self.limited[name] += int(((flags & flag) > 0).sum())
        if self._rendering:
            self._rendering.add(block.where(block["mode"] == ACTIVE))
        paired = block.where(~np.isnan(block["paired_dt"]))
        self.pairs += len(paired)
        if len(paired):
            self.end = float(paired["time"][-1])
        self.depth = float(np.max(np.abs(paired["slave_position"]), initial=self.depth))
        estimated = block.estimated()
        t, regression = estimated["time"], estimated.regression()
        self._averages.begin(t, regression, (estimated["k_bound"], estimated["b_bound"]))
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
        """Fraction of the samples at which the slave touched the specimen.

        Only the part of the trial over which the estimates are averaged is used. The value is NaN
        if this part has no sample, or if the contact was not recorded.
        """
        return self._contact / self._averages.samples if self._averages.samples else math.nan

    @property
    def expected(self) -> dict[str, float]:
        """Half widths of the 95 % intervals of k and b that motion and noise permit, as fractions.

        They are those at the end of the part over which the estimates are averaged; NaN if this
        part has no sample (`estimation.ExpectedIntervals`).
        """
        return self._averages.expected._asdict()

    @property
    def loop(self) -> dict[str, Any]:
        """Statistics of the timing of the control loop, see `RunningTiming.summary`."""
        return self._timing.summary(self._settings.loop_rate)

    def estimates(self, shown: Recording) -> dict[str, Any]:
        """Return averages, errors and last estimates of each estimator, by its name.

        The fields of `EstimatorSummary` are the keys of each summary. The result is empty if there
        is no sample.
        """
        if not self._averages.samples:
            return {}
        shown = shown.estimated()
        found = self._averages.summaries(shown["time"], shown.estimates())
        return {name: summary._asdict() for name, summary in found.items()}

    def feedback(self) -> dict[str, Any] | None:
        """Return the stiffness, force error and energy that the hand felt, see `Rendering`.

        The dictionary also contains the name of the force-feedback law (`law`) and the settings of
        the communication channel between master and slave (`channel`). The result is None if the
        trial has neither force feedback nor a communication channel.
        """
        if not self._rendering:
            return None
        settings = self._settings
        found = felt(self._rendering, self._recording.fault)
        channel = settings.channel and settings.channel.text
        return {
            "law": settings.feedback.law,
            "channel": channel,
            **found._asdict(),
            "stable": found.stable,
        }


def felt(rendering: RunningRendering, fault: Mapping[str, Any] | None) -> Rendering:
    """Return what the hand felt in a trial that this fault ended; None if no fault ended it."""
    name = str(fault["fault"]) if fault else ""
    return rendering.result(name, name in (Fault.OSCILLATION, Fault.PORT_ENERGY))


def recorded_rendering(recording: Recording) -> RunningRendering | None:
    """Return what the hand felt in a recorded trial; None without force feedback or settings."""
    settings = trial_settings(recording)
    if not settings or settings.feedback.law == "none":
        return None
    rendering = rendering_of(recording, settings)
    rendering.add(recording.where(recording["mode"] == ACTIVE))
    return rendering


def rendering_of(ticks: Recording | RecordingFile, settings: TrialSettings) -> RunningRendering:
    """Return an object that computes the stiffness, force and energy that the hand felt.

    The caller must add the ticks of the trial to this object.
    """
    end = 0.0
    for block in ticks.blocks(("time", "mode").__contains__):
        t = block["time"][block["mode"] == ACTIVE]
        end = float(t[-1]) if len(t) else end
    admittance, scale = settings.admittance, settings.coupling.scale
    hand = RunningHand(admittance.mass, admittance.damping, admittance.stiffness, scale)
    arm = None if settings.rig else partial(arm_damping, settings)
    gain = settings.feedback.gain
    law = LAWS.get(settings.feedback.law, MasterHalf)  # a recording can have a law of before
    prior = gain * scale * STIFF_PRIOR if law.displays_prior else None
    known = settings.link_transmission if settings.lost_motion_known else None
    coupling = settings.coupling_stiffness
    return RunningRendering(hand, scale, gain, end, arm, prior, coupling, known, settings.is_glued)
