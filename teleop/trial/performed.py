"""Describe the motion of a trial as text: depth, and target or excitation signal."""

from __future__ import annotations

from teleop.control.excitation_signals import AnySignal, Chirp, Multisine
from teleop.errors import InputError
from teleop.recording.recording import Recording
from teleop.trial.settings import TrialSettings
from teleop.trial.settings_json import from_document


def performed(settings: TrialSettings) -> dict[str, str]:
    """Return a description of the motion in a trial, including default values."""
    if settings.custom_condition:
        return {name: f"{v}" for name, v in settings.custom_condition.parameters.items()}
    found = {"depth": f"{settings.setup.depth * 1e3:.4g} mm"}
    if settings.condition_name == "mimic":
        target = settings.target
        low, high = (1e3 * depth for depth in (target.position(0.0), target.depth))
        found["target"] = f"sine of {target.frequency:g} Hz, from {low:.4g} to {high:.4g} mm"
        found["count-in"] = f"{target.count_in:g} s"
    if settings.condition_name == "autonomous":
        found["signal"] = signal_text(settings.excitation)
    return found


def signal_text(signal: AnySignal) -> str:
    """Return a short description of an excitation signal: its type and its frequencies."""
    if isinstance(signal, Multisine):
        return f"multisine of {', '.join(f'{one:g}' for one in signal.frequencies)} Hz"
    if isinstance(signal, Chirp):
        return f"chirp from {signal.low:g} to {signal.high:g} Hz and back in {signal.sweep:g} s"
    return f"sine of {signal.frequency:g} Hz"


def recorded_motion(recording: Recording) -> dict[str, str]:
    """Return a description of the motion in a recorded trial, as texts by name, see `performed`.

    The dictionary is empty if the settings in the recording are not valid.
    """
    try:
        return performed(from_document(recording.settings))
    except InputError:
        return {}
