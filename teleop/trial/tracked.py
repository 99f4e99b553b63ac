"""Compute how well the slave followed the target in a trial of the condition `mimic`."""

from __future__ import annotations

from teleop.errors import InputError
from teleop.evaluation.kept_parts import Last
from teleop.evaluation.tracking import Tracking, tracking
from teleop.recording.recording import Recording
from teleop.recording.recording_file import RecordingFile
from teleop.trial.settings import TrialSettings
from teleop.trial.settings_json import from_document


def tracking_of(recording: Recording, settings: TrialSettings) -> Tracking | None:
    """Return gain, phase and error of the slave relative to the target in a recorded trial.

    The result is None in three cases: the condition is not `mimic`, the recording has no target, or
    the target moved for less than two periods.
    """
    if settings.condition != "mimic" or "target" not in recording.columns:
        return None
    t, target, position = (recording[name] for name in ("time", "target", "slave_position"))
    return tracking(t, target, position, settings.target.frequency)


def tracked_ticks(ticks: Recording | RecordingFile) -> Recording:
    """Return the ticks from which the tracking is computed; for a long trial, the last ticks."""
    if isinstance(ticks, Recording):
        return ticks
    names = [name for name in ("time", "target", "slave_position") if name in ticks.units]
    last = Last()
    for block in ticks.blocks(names.__contains__):
        last.add(block.columns)
    return Recording(last.columns(names), ticks.units)


def recorded_tracking(recording: Recording) -> Tracking | None:
    """Return the result of `tracking_of` with the recorded settings; None if they are not valid."""
    try:
        return tracking_of(recording, from_document(recording.settings))
    except InputError:
        return None
