"""Samples and settings with which the estimates of a recorded trial are recomputed."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from estimation import Preset
from teleop.errors import InputError, invalid_parts
from teleop.evaluation.estimate_settings import EstimateSettings
from teleop.evaluation.samples import ends_of, measured, with_gaps
from teleop.evaluation.signals import Signals
from teleop.recording.recording import Recording

if TYPE_CHECKING:
    from pydantic import TypeAdapter


def is_replayed(column: str) -> bool:
    """Return whether a column of a recording is needed to compute the true values or the tracking.

    True values exist only for the simulated rig. The tracking is computed from the target and the
    position of the slave.
    """
    return column in ("time", "slave_position", "target")


def is_reported(column: str) -> bool:
    """Return whether a report may show a column. It shows no columns of the estimators."""
    return not column.endswith(("_b", "_k", "_std", "_held", "_misfit"))


def recorded_signals(recording: Recording) -> Signals:
    """Return the samples of a recorded trial before conditioning.

    In the first sample after missing ticks, `paired_dt` is the time since a sample that is missing.
    This value is replaced by the time since the last sample before the gap.

    Raises
    ------
    InputError
        A sample is not finite, or a period is not positive.
    """
    t, x, f, dt = measured(recording.columns)
    return Signals(t, x, f, dt, "slave_position", with_gaps(t, dt, ends_of(recording.gaps)))


def recorded_settings(recording: Recording) -> EstimateSettings:
    """Return the settings of the estimators in a recorded trial.

    With these settings, `evaluate` computes exactly the recorded estimates, bit by bit.

    Raises
    ------
    InputError
        A setting in the recording is missing or invalid.
    """
    from pydantic import ValidationError

    settings = recording.settings
    try:
        made: EstimateSettings = validator(EstimateSettings).validate_python(
            {
                "datum": "file",
                "preset": validator(Preset).validate_python(settings["preset"]),
                "conditioning": settings["conditioning"],
                "bandwidth": settings["bandwidth_hz"],
                "force_lag": settings["force_lag_s"],
                "whole": True,
                "resolution": settings["encoder_resolution_m"],
                "cube": settings["cube"],
            }
        )
        return made
    except KeyError as error:
        raise InputError(f"the recording lacks the setting {error} of the estimators") from error
    except ValidationError as error:
        raise InputError(
            "the recording has invalid settings of the estimators: " + invalid_parts(error)
        ) from error


@cache
def validator(kind: type) -> TypeAdapter[Any]:
    """Return the pydantic object that checks settings of the class `kind`; it is cached."""
    from pydantic import TypeAdapter

    return TypeAdapter(kind)
