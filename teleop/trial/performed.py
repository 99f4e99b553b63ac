"""Describe the motion of a trial as text: depth, and target or excitation signal."""

from __future__ import annotations

from teleop.errors import InputError
from teleop.recording.recording import Recording
from teleop.settings.documents import from_document
from teleop.settings.trial_settings import TrialSettings


def performed(settings: TrialSettings) -> dict[str, str]:
    """Return a description of the motion in a trial, including default values."""
    if settings.custom_condition:
        return {name: f"{v}" for name, v in settings.custom_condition.parameters.items()}
    return settings.condition_type.motion_texts(settings.intended_motion)


def recorded_motion(recording: Recording) -> dict[str, str]:
    """Return a description of the motion in a recorded trial, as texts by name, see `performed`.

    The dictionary is empty if the settings in the recording are not valid.
    """
    try:
        return performed(from_document(recording.settings))
    except InputError:
        return {}
