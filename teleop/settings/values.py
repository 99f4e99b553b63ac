"""Types of the values in the settings: units, texts, and files that a document names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationInfo
from pydantic_core import PydanticCustomError

from drivers.rig_file import RigFileError, parse_rig_file
from estimation import MODELS
from teleop.control.tare import read_tare
from teleop.control.wanted_precision import parse_wanted
from teleop.errors import InputError
from teleop.settings import ranges
from teleop.settings.custom_class import CustomClass, stated_part
from teleop.settings.plug_ins import PartName
from teleop.settings.protocol_files import load_protocol
from teleop.settings.rig_loading import load_rig_file

FILE = "file"
"""Type of the error of pydantic for an invalid file that the settings name."""

Seconds = Annotated[float, Field(json_schema_extra={"unit": "s"})]
Hertz = Annotated[float, Field(json_schema_extra={"unit": "Hz"})]
Metres = Annotated[float, Field(json_schema_extra={"unit": "m"})]
Newtons = Annotated[float, Field(json_schema_extra={"unit": "N"})]
ModelName = Annotated[str, Field(json_schema_extra={"enum": [*MODELS]})]


def one_line(text: str) -> str:
    """Check that a text is a name on one line."""
    if len(text) > ranges.NAME or not (text.isprintable() and text == text.strip()):
        raise ValueError(f"expected one line of at most {ranges.NAME} characters")
    return text


def without_zero(text: str) -> str:
    """Check that a text can be recorded."""
    if "\0" in text:
        raise ValueError("expected Unicode text without the character zero")
    return text


def model_of(value: object) -> object:
    """Return the model with a name. Other values remain, for pydantic to check."""
    if not isinstance(value, str):
        return value
    if value not in MODELS:
        raise ValueError(f"expected one of {', '.join(MODELS)}")
    return MODELS[value]


def wanted_of(value: object) -> object:
    """Return the wanted precision in a text. Other values remain, for pydantic to check."""
    return parse_wanted(value) if isinstance(value, str) else value


def tare_of(value: object, info: ValidationInfo) -> object:
    """Return the content of a tare file. Other values remain, for pydantic to check."""
    try:
        return read_tare(folder(info) / value) if isinstance(value, str) else value
    except InputError as error:
        raise in_file(error) from error


def rig_of(value: object, info: ValidationInfo) -> object:
    """Return the content of a rig file, from its path or from its text in a recording.

    Other values remain, for pydantic to check.
    """
    try:
        if isinstance(value, str):
            return load_rig_file(folder(info) / value)
        if isinstance(value, Mapping):
            return parse_rig_file(Path(value["path"]), value["toml"])
    except (InputError, RigFileError) as error:
        raise in_file(error) from error
    except (TypeError, KeyError) as error:
        raise ValueError("expected a path and the text of a rig file") from error
    return value


def stated(part: PartName) -> Callable[[CustomClass | None], CustomClass | None]:
    """Return a function that completes the statement about a part of another package."""

    def complete(value: CustomClass | None) -> CustomClass | None:
        """Return the complete statement."""
        try:
            return value and stated_part(part, value)
        except InputError as error:
            raise in_file(error) from error

    return complete


def protocol_named(value: object, info: ValidationInfo) -> object:
    """Return the protocol with a name or of a file. Other values remain, for pydantic to check."""
    try:
        return load_protocol(value, folder(info)) if isinstance(value, str) else value
    except InputError as error:
        raise in_file(error) from error


def folder(info: ValidationInfo) -> Path:
    """Return the folder to which paths in a document are relative."""
    return info.context or Path()


def in_file(error: Exception) -> PydanticCustomError:
    """Return an error of pydantic with the problems of a file, one a line."""
    return PydanticCustomError(FILE, "{text}", {"text": str(error)})
