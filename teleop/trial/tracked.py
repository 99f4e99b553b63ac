"""Compute how well the slave followed the target in a trial of a condition with a target."""

from __future__ import annotations

from teleop.errors import InputError
from teleop.evaluation.reading.recorded import Last
from teleop.evaluation.teleoperation.tracking import Tracking, tracking
from teleop.recording.recording import Recording
from teleop.recording.recording_file import RecordingFile
from teleop.settings.documents import from_document
from teleop.settings.trial_settings import TrialSettings


def tracking_of(recording: Recording, settings: TrialSettings) -> Tracking | None:
    """Return numbers that describe how well the slave followed the target in a recorded trial.

    The numbers are, for example, gain, phase and error of the position of the slave relative to the
    target. The result is None in three cases: the condition has no target, the recording has no
    target, or the target moved for too few periods (`FEWEST` in
    `teleop.evaluation.teleoperation.tracking`).
    """
    target_motion = settings.target
    if target_motion is None or "target" not in recording.columns:
        return None
    t, target, position = (recording[name] for name in ("time", "target", "slave_position"))
    return tracking(t, target, position, target_motion.frequency)


def tracked_ticks(ticks: Recording | RecordingFile) -> Recording:
    """Select the ticks from which `tracking_of` computes how well the slave followed the target.

    If the ticks are in memory, all ticks are returned. If they must be read from a file, only the
    last ticks are returned, to save memory.
    """
    if isinstance(ticks, Recording):
        return ticks
    names = [name for name in ("time", "target", "slave_position") if name in ticks.units]
    last = Last()
    for block in ticks.blocks(names.__contains__):
        last.add(block.columns)
    return Recording(last.columns(names), ticks.units)


def recorded_tracking(recording: Recording) -> Tracking | None:
    """Return numbers that describe how well the slave followed the target in a recorded trial.

    This function calls `tracking_of` with the settings in the recording. The result is also None if
    these settings are not valid.
    """
    try:
        return tracking_of(recording, from_document(recording.settings))
    except InputError:
        return None
