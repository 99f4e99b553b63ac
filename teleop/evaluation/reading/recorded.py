"""Read the samples and settings of a recorded trial, to recompute its estimates."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from estimation import Preset
from teleop.errors import InputError, invalid_parts
from teleop.evaluation.reading.samples import ends_of, measured, with_gaps
from teleop.evaluation.reading.signals import Signals
from teleop.evaluation.settings import EstimateSettings
from teleop.recording.recording import Recording

if TYPE_CHECKING:
    from pydantic import TypeAdapter


def is_replayed(column: str) -> bool:
    """Return whether a column of a recording is needed besides the samples of the estimators.

    From the selected columns, two things are computed: how well the slave follows the target, and
    the true values of b and k, which are known for the simulated rig only. The parameter `column`
    is the name of the column.
    """
    return column in ("time", "slave_position", "target")


def is_reported(column: str) -> bool:
    """Return whether a column of a recording may be shown in a report.

    Columns with recorded results of the estimators are not shown. The parameter `column` is the
    name of the column.
    """
    return not column.endswith(("_b", "_k", "_std", "_held", "_misfit"))


def recorded_signals(recording: Recording) -> Signals:
    """Return the measured samples of a recorded trial, as they were before the filters.

    In a gap of the recording, samples are missing. The first sample after a gap has a recorded
    period `paired_dt` that is too short: it is the time since the last missing sample. It is
    replaced by the time since the last sample before the gap.

    Raises
    ------
    InputError
        A sample is not finite, or a sample period is not positive.
    """
    t, x, f, dt = measured(recording.columns)
    return Signals(t, x, f, dt, "slave_position", with_gaps(t, dt, ends_of(recording.gaps)))


def recorded_settings(recording: Recording) -> EstimateSettings:
    """Return the settings that the estimators had in a recorded trial.

    With these settings, `teleop.evaluation.evaluate.evaluate` computes exactly the estimates that
    were recorded in the trial.

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
                "cube": settings.get("cube") or EstimateSettings.cube,
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
    """Return the object of the library pydantic that checks values of the class `kind`.

    It is made in the first call for each class, and is used again in later calls.
    """
    from pydantic import TypeAdapter

    return TypeAdapter(kind)
