"""Read TOML files. All errors are raised as `InputError`."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from drivers.input_file import read_input
from drivers.problems import syntax_problem
from teleop.errors import InputError
from teleop.files import unreadable


def read_toml(path: Path) -> dict[str, Any]:
    """Return the contents of a TOML file as a dictionary."""
    text = ""
    try:
        text = read_input(path).decode()
        return tomllib.loads(text)
    except OSError as error:
        raise unreadable(path, error) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {syntax_problem(error, text)}") from error
