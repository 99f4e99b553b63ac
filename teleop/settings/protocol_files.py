"""Read protocols: those of this package by name, and files of users (TOML)."""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from teleop.control.protocol import ProtocolSettings
from teleop.errors import InputError, invalid_lines
from teleop.settings.toml_files import read_toml

FOLDER = "protocols"
"""Folder of this package with the protocols."""


def included() -> list[str]:
    """Return the names of the protocols of this package."""
    folder = files(__package__).joinpath(FOLDER)
    return sorted(file.name.removesuffix(".toml") for file in folder.iterdir())


@cache
def adapter() -> TypeAdapter[ProtocolSettings]:
    """Return the pydantic object that checks a protocol, which refuses unknown keys."""
    return TypeAdapter(ProtocolSettings)


def protocol_of(value: object, folder: Path) -> ProtocolSettings:
    """Return a protocol: that with a name or of a file, or that in a document.

    Raises
    ------
    InputError
        There is no such protocol, or it is not valid. The message has one line for each problem.
    """
    if isinstance(value, str):
        return load_protocol(value, folder)
    try:
        return adapter().validate_python(value)
    except ValidationError as error:
        raise InputError("\n".join(invalid_lines(error))) from error


def load_protocol(name: str, folder: Path = Path()) -> ProtocolSettings:
    """Read a protocol, by its name in this package or by the path of a file.

    Raises
    ------
    InputError
        There is no such protocol, or it is not valid. The message has one line for each problem.
    """
    packaged = files(__package__).joinpath(FOLDER, f"{name}.toml")
    path = folder / name
    if not path.suffix and not path.exists():
        if not packaged.is_file():
            known = ", ".join(included())
            raise InputError(f"protocol {name!r}: expected a file, or one of {known}")
        with as_file(packaged) as source:
            document = read_toml(source)
    else:
        document = read_toml(path)
    try:
        return protocol_of({"name": Path(name).stem, **document}, folder)
    except InputError as error:
        lines = str(error).splitlines()
        raise InputError("\n".join(f"{name}: {line}" for line in lines)) from error
