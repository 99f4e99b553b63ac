"""Compute how well the slave followed the target in a trial of the condition `mimic`."""

from __future__ import annotations

from teleop.errors import InputError
from teleop.evaluation.tracking import Tracking, tracking
from teleop.recording.recording import Recording
from teleop.trial.settings import TrialSettings
from teleop.trial.settings_json import from_document


def tracking_of(recording: Recording, settings: TrialSettings) -> Tracking | None:
    """Return gain, phase and error of the slave relative to the target in a recorded trial.

    The result is None if the condition is not `mimic`, or if the recording has no target.
    """
    if settings.condition != "mimic" or "target" not in recording.columns:
        return None
    t, target, position = (recording[name] for name in ("time", "target", "slave_position"))
    return tracking(t, target, position, settings.target.frequency)


def recorded_tracking(recording: Recording) -> Tracking | None:
    """Return the result of `tracking_of` with the recorded settings; None if they are not valid."""
    try:
        return tracking_of(recording, from_document(recording.settings))
    except InputError:
        return None
