"""Determine the part of a trial over which the estimates are averaged."""

from __future__ import annotations

from teleop.errors import InputError
from teleop.evaluation.settings import WHOLE, AveragedPart
from teleop.recording.recording import Recording
from teleop.recording.recording_file import RecordingFile
from teleop.settings.documents import from_document
from teleop.settings.trial_settings import TrialSettings


def averaged_part(recording: Recording | RecordingFile, settings: TrialSettings) -> AveragedPart:
    """Return the part of a recorded trial over which the estimates are averaged."""
    part = AveragedPart(*settings.condition_type.averaged_times(settings.intended_motion))
    if settings.target and "target" not in recording.units:
        part = WHOLE  # recorded by a version whose target had no count-in
    armed = next((event["time"] for event in recording.events if event["mode"] == "active"), 0.0)
    return part.after(armed)


def recorded_part(recording: Recording) -> AveragedPart:
    """Return the part of a trial over which the estimates are averaged, from its recording only.

    The settings of the trial are read from the recording. If they are not valid, the result is the
    whole trial.
    """
    try:
        return averaged_part(recording, from_document(recording.settings))
    except InputError:
        return WHOLE
