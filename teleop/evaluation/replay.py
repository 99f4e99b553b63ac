"""A recorded trial as input of the estimators, and whether they give again what it computed."""

from __future__ import annotations

import numpy as np

from estimation import Preset
from teleop.errors import InputError, invalid_parts
from teleop.evaluation.evaluation import EstimateSettings, Evaluation
from teleop.evaluation.signals import Signals
from teleop.evaluation.units import LARGEST
from teleop.recording.recording import Recording


def recorded_signals(recording: Recording) -> Signals:
    """What the estimators were given in a recorded trial, before conditioning.

    Where ticks are missing, the recorded `paired_dt` is the time since a pair that is missing
    too; the time since the pair before the gap takes its place.

    Raises
    ------
    InputError
        A sample is not finite, or a period is not positive.
    """
    r = recording.estimated()
    names = ("time", "paired_position", "paired_force", "paired_dt")
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
    """The settings with which a recorded trial estimated; they give its estimates to the bit.

    Raises
    ------
    InputError
        The recording does not tell them.
    """
    from pydantic import TypeAdapter, ValidationError

    settings = recording.settings
    try:
        return TypeAdapter(EstimateSettings).validate_python(
            {
                "datum": "file",
                "preset": TypeAdapter(Preset).validate_python(settings["preset"]),
                "conditioning": settings["conditioning"],
                "bandwidth": settings["bandwidth_hz"],
                "force_lag": settings["force_lag_s"],
                "whole": True,
                "resolution": settings["encoder_resolution_m"],
            }
        )
    except KeyError as error:
        raise InputError(f"the recording has no setting {error} of its estimators") from error
    except ValidationError as error:
        raise InputError(
            "the recording's settings of its estimators are not as expected: "
            + invalid_parts(error)
        ) from error


def agrees(evaluation: Evaluation, recording: Recording) -> bool:
    """Whether the estimates are those that the trial computed online, to the bit.

    Never where ticks are missing: the trial's estimators were given those as well.
    """
    if recording.gaps:
        return False
    online = recording.estimated().estimates()
    return list(online) == list(evaluation.estimates) and all(
        np.array_equal(ours, theirs, equal_nan=True)
        for name, estimates in evaluation.estimates.items()
        for ours, theirs in zip(estimates[:2], online[name][:2], strict=True)
    )
