"""Read and write configuration files, which contain the settings of a trial in TOML.

The keys are the same as in the JSON document of the settings, see `teleop.settings.documents`.
"""

from __future__ import annotations

import contextlib
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from estimation import MODELS
from teleop.errors import InputError
from teleop.files import RECORDING
from teleop.recording.recording import load
from teleop.settings.documents import checked, to_document
from teleop.settings.feedback_checks import check_feedback
from teleop.settings.problems import DERIVED
from teleop.settings.protocol_files import protocol_of
from teleop.settings.toml_files import read_toml
from teleop.settings.trial_settings import KEYS, TrialSettings, schema

if TYPE_CHECKING:
    from tomlkit.items import Table


NEEDED_ON_RIG = {"specimen": "the name of the specimen", "depth_m": "the depth of palpation [m]"}
"""Settings that every trial on a hardware rig requires: the key and a description of each."""


def read_configuration(path: Path, complete: bool = False) -> TrialSettings:
    """Read the settings of a trial from a configuration file or a recording.

    Parameters
    ----------
    path
        A TOML file, or a recording (.mcap). In a TOML file, `rig` is the path of a rig file, and
        `tare` the path of a file that `teleop rig tare` wrote. The two paths are relative to the
        folder of the TOML file. A setting that is not in the file has its default value.
    complete
        Whether to check also that no required setting is missing, and that the force feedback may
        be used, see `complete_settings`.

    Raises
    ------
    InputError
        The file cannot be read, or a setting is unknown or invalid. The message has one line for
        each problem.
    """
    recorded = path.suffix.lower() == RECORDING
    document = recorded_document(path) if recorded else read_toml(path)
    try:
        read = complete_settings if complete else settings_from
        settings = read(document, path.parent)
        if settings.rig and settings.custom_limits:
            raise InputError("custom_limits: not with a hardware rig: expected tightened_limits")
        return settings
    except InputError as error:
        lines = str(error).splitlines()
        raise InputError("\n".join(f"{path}: {line}" for line in lines)) from error


def recorded_document(path: Path) -> dict[str, Any]:
    """Return the settings in a recording, as a dictionary for `settings_from`."""
    if settings := load(path, "time".__eq__).settings:
        return as_recorded_now(settings)
    raise InputError(f"{path}: the recording contains no settings: expected those of a trial")


def as_recorded_now(document: Mapping[str, Any]) -> dict[str, Any]:
    """Convert settings that any version of teleop recorded to settings of the present version.

    Values that were computed from other settings are removed. Two settings are removed if they had
    no effect in the recorded trial: `cube` (the simulated body) on a hardware rig, and `signal`
    (the excitation signal) in the condition `mimic` before version 0.2. Without `lost_motion_m`,
    the version of the recording did not correct the estimators for lost motion.
    """
    ignored = document.get("condition") == "mimic" and KEYS["count_in"] not in document
    removed = {
        *DERIVED,
        *(["signal"] if ignored else []),
        *(["cube"] if document.get("rig") else []),
    }
    lost = {} if KEYS["lost_motion"] in document else {KEYS["lost_motion"]: 0.0}
    return {key: value for key, value in document.items() if key not in removed} | lost


def settings_from(document: Mapping[str, Any], folder: Path) -> TrialSettings:
    """Return the settings in a configuration file. Paths in it are relative to `folder`."""
    problems = []
    if document.get("rig") and "cube" in document:
        problems.append("cube: belongs to the simulated rig: expected no cube beside a rig")
    with raised_together(problems):
        return checked(with_duration(document, folder), folder)


def with_duration(document: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Return a document in which a protocol without a duration gets the longest that it can take.

    An invalid protocol is left for the check of all settings.
    """
    protocol = document.get("protocol")
    if protocol is None or KEYS["duration"] in document:
        return document
    with contextlib.suppress(InputError):
        return {**document, KEYS["duration"]: protocol_of(protocol, folder).longest}
    return document


def complete_settings(
    document: Mapping[str, Any], folder: Path, place: str = "the file"
) -> TrialSettings:
    """Return the settings in a configuration file, and check that a trial can use them.

    No setting that a hardware rig needs may be missing (`place` states where the user can add it),
    and the force feedback must be permitted (`check_feedback`).
    """
    problems = [
        f"{key}: is missing: expected {what} in {place}, for a trial on a hardware rig"
        for key, what in NEEDED_ON_RIG.items()
        if document.get("rig") and not document.get(key)
    ]
    with raised_together(problems):
        settings = settings_from(document, folder)
        check_feedback(settings)
    return settings


@contextlib.contextmanager
def raised_together(problems: list[str]) -> Iterator[None]:
    """Raise the problems, and those of an InputError within the block, as one InputError."""
    try:
        yield
    except InputError as error:
        problems += str(error).splitlines()
    if problems:
        raise InputError("\n".join(problems))


def write_configuration(settings: TrialSettings) -> str:
    """Return the text of a configuration file with the settings and a comment for each setting."""
    import tomlkit

    document = without_none(to_document(settings))
    if MODELS.get(settings.model.name) == settings.model:
        document["model"] = settings.model.name
    described = schema()
    file = tomlkit.document()
    file.add(tomlkit.comment("Configuration of a trial: teleop run --config FILE"))
    file.add(tomlkit.comment("Quantities are in SI units. A key that is left out has its default."))
    names = {key: name for name, key in KEYS.items()}
    is_table = {key: isinstance(document.get(key), Mapping) for key in names}
    for key in sorted(names, key=is_table.__getitem__):  # TOML has its tables last
        file.add(tomlkit.nl())
        for line in textwrap.wrap(described["properties"][key]["description"], 88):
            file.add(tomlkit.comment(line))
        if document.get(key) is None:
            file.add(tomlkit.comment(f"{key} ="))
        elif is_table[key]:
            kind = type(getattr(settings, names[key])).__name__
            file.add(
                key, table(document[key], described["$defs"].get(kind, {}).get("properties", {}))
            )
        else:
            file.add(key, document[key])
    return tomlkit.dumps(file)


def without_none(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy without the keys whose value is None, because TOML has no such value."""
    return {
        key: without_none(value) if isinstance(value, Mapping) else value
        for key, value in values.items()
        if value is not None
    }


def table(values: Mapping[str, Any], properties: Mapping[str, Any]) -> Table:
    """Return a TOML table with values, and with the description of each key as a comment.

    A key of `properties` (JSON schemas) that has no value is written as a comment only.
    """
    import tomlkit

    found = tomlkit.table()
    for key in {**properties, **values}:
        description = " ".join(properties.get(key, {}).get("description", "").split()).rstrip(".")
        if key not in values:
            found.add(tomlkit.comment(f"{key} = # {description}"))
            continue
        item = tomlkit.item(values[key])
        if description:
            item.comment(description)
        found.add(key, item)
    return found
