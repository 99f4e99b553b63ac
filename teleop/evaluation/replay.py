"""Recompute the estimates of a recorded trial, and compare them with the recorded estimates."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from estimation import Preset
from teleop.errors import InputError, invalid_parts
from teleop.evaluation.estimate_settings import EstimateSettings
from teleop.evaluation.evaluation import Evaluation
from teleop.evaluation.signals import Signals
from teleop.evaluation.units import LARGEST
from teleop.recording.recording import Recording

if TYPE_CHECKING:
    from pydantic import TypeAdapter

NEEDED = ("time", "dt", "dropped", "x", "paired_position", "paired_force", "paired_dt")
"""Columns that are needed to evaluate a recorded trial."""


def is_replayed(column: str) -> bool:
    """Return whether a column is needed for an evaluation, its checks, or the tracking."""
    return column in (*NEEDED, "slave_position", "target") or column.endswith(("_b", "_k"))


def recorded_signals(recording: Recording) -> Signals:
    """Return the samples of a recorded trial before conditioning.

    In the first sample after missing ticks, `paired_dt` is the time since a sample that is missing.
    This value is replaced by the time since the last sample before the gap.

    Raises
    ------
    InputError
        A sample is not finite, or a period is not positive.
    """
    names = ("time", "paired_position", "paired_force", "paired_dt")
    part = np.isfinite(recording["x"])
    r = {name: recording[name][part] for name in names}
    for name in names:
        if not (np.abs(r[name]) < LARGEST).all():
            raise InputError(f"the recording's {name} is not finite in every sample")
    if not (r["paired_dt"] > 0.0).all():
        raise InputError("the recording's paired_dt is not positive in every sample")
    t, x, f, dt = (r[name] for name in names)
    dt = dt.copy()
    ends = [gap.end for gap in recording.gaps if gap.end is not None]
    gaps = [int(i) for i in np.unique(np.searchsorted(t, ends)) if i < len(t)]
    for i in gaps:
        dt[i] = t[i] - t[i - 1] if i else dt[i]
    return Signals(t, x, f, dt, "slave_position", tuple(gaps))


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


def agrees(evaluation: Evaluation, recording: Recording) -> bool:
    """Return whether the estimates equal the recorded estimates exactly, bit by bit.

    If ticks are missing in the recording, the result is False: the estimators used the missing
    ticks in the trial, so that the estimates cannot be recomputed.
    """
    if recording.gaps:
        return False
    online = recording.estimated().estimates()
    return list(online) == list(evaluation.estimates) and all(
        np.array_equal(ours, theirs, equal_nan=True)
        for name, estimates in evaluation.estimates.items()
        for ours, theirs in zip(estimates[:2], online[name][:2], strict=True)
    )
