"""A rig file as the command line takes it: one line for each thing that is wrong in it."""

from __future__ import annotations

from pathlib import Path

from drivers.rig_file import RigFile, RigFileError, read_rig_file
from teleop.errors import InputError
from teleop.files import unreadable
from teleop.safety.rig_limits import rig_limits


def load_rig_file(path: Path) -> RigFile:
    """Read and check a rig file, its limits too.

    Raises
    ------
    InputError
        It cannot be read, or is not as expected.
    """
    try:
        rig_file = read_rig_file(path)
    except OSError as error:
        raise unreadable(path, error) from error
    except RigFileError as error:
        raise InputError(str(error)) from error
    try:
        rig_limits(rig_file.sections)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    return rig_file
