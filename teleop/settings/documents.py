"""Convert the settings of a trial to a JSON document, and back without any change."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic_core import to_jsonable_python

from teleop.settings.problems import DERIVED
from teleop.settings.trial_settings import KEYS, TrialSettings, adapter


def to_document(settings: TrialSettings) -> dict[str, Any]:
    """Return the settings as a JSON document (a dictionary).

    The document also contains values that are computed from the settings (`DERIVED`). An infinite
    number becomes the text `Infinity`, which `from_document` converts back.
    """
    document = {key: getattr(settings, name) for name, key in KEYS.items()}
    if not settings.is_simulated:
        del document["cube"]
    if rig := settings.rig:
        document["rig"] = {"name": settings.rig_name, "path": rig.path, "toml": rig.text}
    document |= {
        "preset": settings.estimation_preset,
        "encoder_resolution_m": settings.encoder_resolution,
        "loop_rate_hz": settings.loop_rate,
        "limits": asdict(settings.limits),
        "online_transmission": {
            name: getattr(settings.online_transmission, name)
            for name in ("force_lag", "lost_motion", "delay_share")
        },
        **({"setup": settings.setup} if settings.is_simulated else {}),
    }
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
    """
    return checked({key: value for key, value in document.items() if key not in DERIVED})


def checked(document: Mapping[str, Any], folder: Path = Path()) -> TrialSettings:
    """Return the settings in a document. Paths in it are relative to `folder`.

    Raises
    ------
    SettingsError
        A setting is unknown or invalid. The message has one line for each problem.
    """
    return adapter().validate_python(document, context=folder, by_alias=True, by_name=False)
