"""Settings of a trial as a JSON document, with an exact round trip."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_jsonable_python

from drivers.rig_file import RigFile, RigFileError, parse_rig_file
from teleop.errors import InputError, invalid_parts
from teleop.trial.settings import TrialSettings

NAMES = {
    "duration": "duration_s",
    "rate": "rate_hz",
    "bandwidth": "bandwidth_hz",
    "force_lag": "force_lag_s",
    "depth": "depth_m",
    "preset": "custom_preset",
}
"""Names in the document that differ from those of the settings."""


def to_document(settings: TrialSettings) -> dict[str, Any]:
    """Return the settings as values of JSON, together with values derived from them.

    An infinite number becomes the text `Infinity`, which `from_document` converts back.
    """
    stated = {field.name: getattr(settings, field.name) for field in fields(settings)}
    if rig := settings.rig:
        stated["rig"] = {"name": settings.rig_name, "path": rig.path, "toml": rig.text}
    derived = {
        "preset": settings.estimation_preset,
        "encoder_resolution_m": settings.encoder_resolution,
        "limits": asdict(settings.limits),
        **({} if rig else {"setup": settings.setup}),
    }
    document = {NAMES.get(name, name): value for name, value in stated.items()} | derived
    text = json.dumps(to_jsonable_python(document))
    values: dict[str, Any] = json.loads(text, parse_constant=str)
    return values


def from_document(document: Mapping[str, Any]) -> TrialSettings:
    """Return the settings in a document of `to_document`.

    Raises
    ------
    InputError
        A setting is missing or invalid, as in the documents of teleop 0.1.
    """
    given = {name: document.get(NAMES.get(name, name), MISSING) for name in setting_names()}
    missing = [NAMES.get(name, name) for name, value in given.items() if value is MISSING]
    if missing:
        raise InputError(f"settings of a trial: no {', '.join(missing)}")
    if given["rig"] is not None:
        given["rig"] = rig_file(given["rig"])
    try:
        return adapter().validate_python(given)
    except ValidationError as error:
        raise InputError(f"settings of a trial: {invalid_parts(error)}") from error


MISSING = object()
"""Stands for a setting that a document does not have."""


def setting_names() -> list[str]:
    """Return the names of all settings."""
    return [field.name for field in fields(TrialSettings)]


@cache
def adapter() -> TypeAdapter[TrialSettings]:
    """Return the pydantic adapter that creates settings from values of JSON."""
    return TypeAdapter(TrialSettings)


def rig_file(document: Any) -> RigFile:
    """Return the rig file whose path and text a document contains.

    Raises
    ------
    InputError
        The path or the text is missing, or the text is not a valid rig file.
    """
    try:
        return parse_rig_file(Path(document["path"]), document["toml"])
    except (TypeError, KeyError) as error:
        raise InputError("settings of a trial: rig: expected a path and the TOML text") from error
    except RigFileError as error:
        raise InputError(str(error)) from error
