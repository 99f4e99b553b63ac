"""Determine the part of a trial over which the estimates are averaged.

In the condition `mimic`, the count-in is left out: the time at the start in which the target does
not move yet. In the condition `autonomous`, the ramp at the end is left out: the time in which the
excitation decreases to zero.
"""

from __future__ import annotations

from teleop.control.injector import ramp_time
from teleop.errors import InputError
from teleop.evaluation.settings import WHOLE, AveragedPart
from teleop.recording.recording import Recording
from teleop.recording.recording_file import RecordingFile
from teleop.trial.settings import TrialSettings
from teleop.trial.settings_json import from_document


def averaged_part(recording: Recording | RecordingFile, settings: TrialSettings) -> AveragedPart:
    """Return the part of a recorded trial over which the estimates are averaged."""
    part, count_in = WHOLE, settings.target.count_in
    if settings.condition_name == "mimic" and count_in and "target" in recording.units:
        part = AveragedPart(start=count_in, left_out=f"the count-in of {count_in:g} s")
    elif settings.condition_name == "autonomous":
        ramp = ramp_time(settings.duration)
        text = f"the ramp of the excitation to zero, the last {ramp:g} s"
        part = AveragedPart(end=settings.duration - ramp, left_out=text)
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
