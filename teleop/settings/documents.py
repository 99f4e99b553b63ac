"""Convert the settings of a trial to a JSON document, and back without any change."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import to_jsonable_python

from drivers.problems import given, value_problem
from drivers.rig_file import RigFile, RigFileError, parse_rig_file
from estimation import Axis, Grid, Model, Preset
from estimation.own_settings import OwnSettings
from sim_backend import (
    Changing,
    Cube,
    OperatorModel,
    Relaxing,
    Sensors,
    Setup,
    Transmission,
)
from teleop.control.admittance import AdmittanceParameters
from teleop.control.channel import ChannelSettings
from teleop.control.coupling import Coupling
from teleop.control.excitation_signals import Chirp, Multisine, Sine
from teleop.control.feedback.settings import FeedbackSettings
from teleop.control.tare import Tare
from teleop.errors import InputError
from teleop.safety import ChannelLimits, Limits
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.checks import SettingsError
from teleop.settings.custom_class import CustomClass
from teleop.settings.keys import FIELDS, NAMES, expected_form, unknown_key
from teleop.settings.trial_settings import TrialSettings

DERIVED = {
    "preset": ": expected estimator_parameters or custom_preset",
    "encoder_resolution_m": "",
    "loop_rate_hz": ": expected rate_hz",
    "limits": ": expected tightened_limits",
    "setup": ": expected custom_setup",
}
"""Keys of values that `to_document` computes from the settings. They are not permitted in a
configuration file. The value of a key is the end of the error message in this case."""
PARTS = (
    AdmittanceParameters,
    Axis,
    Changing,
    ChannelLimits,
    ChannelSettings,
    Chirp,
    Coupling,
    Cube,
    CustomClass,
    FeedbackSettings,
    Grid,
    Limits,
    Model,
    Multisine,
    OperatorModel,
    OwnSettings,
    Preset,
    Relaxing,
    Sensors,
    Setup,
    Sine,
    Tare,
    TightenedLimits,
    Transmission,
    TrialSettings,
)
"""Dataclasses whose fields are keys of the document."""
BODIES = ("Cube", "Relaxing", "Changing")
"""Names of the classes of bodies. Error paths of pydantic contain them, but documents do not."""


def to_document(settings: TrialSettings) -> dict[str, Any]:
    """Return the settings as a JSON document (a dictionary).

    The document also contains values that are computed from the settings (`DERIVED`). An infinite
    number becomes the text `Infinity`, which `from_document` converts back.
    """
    stated = {field.name: getattr(settings, field.name) for field in fields(settings)}
    if not settings.is_simulated:
        del stated["cube"]
    if rig := settings.rig:
        stated["rig"] = {"name": settings.rig_name, "path": rig.path, "toml": rig.text}
    derived = {
        "preset": settings.estimation_preset,
        "encoder_resolution_m": settings.encoder_resolution,
        "loop_rate_hz": settings.loop_rate,
        "limits": asdict(settings.limits),
        **({"setup": settings.setup} if settings.is_simulated else {}),
    }
    document = {NAMES.get(name, name): value for name, value in stated.items()} | derived
    text = json.dumps(to_jsonable_python(document))
    values: dict[str, Any] = json.loads(text, parse_constant=str)
    return values


def from_document(document: Mapping[str, Any]) -> TrialSettings:
    """Return the settings in a JSON document (a dictionary) that `to_document` created.

    A setting that is not in the document has its default value.

    Raises
    ------
    SettingsError
        A setting is unknown or invalid. The message has one line for each problem.
    InputError
        The text of the recorded rig file is invalid.
    """
    given = {key: value for key, value in document.items() if key not in DERIVED}
    if isinstance(given.get("rig"), Mapping):
        given["rig"] = rig_file(given["rig"])
    try:
        return adapter().validate_python(given)
    except ValidationError as error:
        found = SettingsError(problems(error))
        bad = {str(part["loc"][0]) for part in error.errors() if part["loc"]}
        if bad:
            try:
                from_document({key: value for key, value in given.items() if key not in bad})
            except SettingsError as error_of_rest:
                others = error_of_rest.known({FIELDS.get(key, key) for key in bad})
                found = SettingsError([*found.own, *others.own], others.of_rig)
        raise found from error


def problems(error: ValidationError) -> list[str]:
    """Return a message for each problem that pydantic found in the settings of a document.

    Each message begins with the keys that lead to the invalid value, for example `signal.kind`.
    """
    lines = []
    for part in error.errors():
        place, kind, value = part["loc"] or ("document",), part["type"], part["input"]
        message = value_problem(part)
        if kind == "unexpected_keyword_argument":
            message = unknown_key(place)
        elif kind.endswith("_type") or kind == "union_tag_not_found":
            form = expected_form(place, value)
            message = f"{form}{given(value)}" if form else message
        path = ".".join(str(key) for key in place if key not in BODIES)
        lines.append(f"{path}: {message}")
    return lines


@cache
def adapter() -> TypeAdapter[TrialSettings]:
    """Return the pydantic object that checks a document and converts it to `TrialSettings`.

    An unknown key in the document is an error.
    """
    for part in PARTS:
        config = ConfigDict(extra="forbid", use_attribute_docstrings=True)
        if part is TrialSettings:
            config["alias_generator"] = lambda name: NAMES.get(name, name)
        setattr(part, "__pydantic_config__", config)  # noqa: B010
    return TypeAdapter(TrialSettings)


def rig_file(document: Mapping[str, Any]) -> RigFile:
    """Return the rig file that a document of settings contains, as a checked `RigFile`.

    Parameters
    ----------
    document
        The value of the key `rig` in the document of settings. It contains the path of the rig file
        (`path`) and its text (`toml`).

    Raises
    ------
    InputError
        The document has no path or no text, or the text is not a valid rig file.
    """
    try:
        return parse_rig_file(Path(document["path"]), document["toml"])
    except (TypeError, KeyError) as error:
        raise InputError("rig: expected a path and the text of a rig file") from error
    except RigFileError as error:
        raise InputError(str(error)) from error
