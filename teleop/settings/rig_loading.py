"""Load rig files, which describe hardware rigs. All errors are raised as `InputError`."""

from __future__ import annotations

import sys
from pathlib import Path

from drivers.registry import RIGS, offered
from drivers.rig_file import RigFile, RigFileError, read_rig_file
from teleop.errors import InputError
from teleop.files import unreadable
from teleop.safety.rig_limits import rig_limits


def load_rig_file(path: Path) -> RigFile:
    """Read a rig file, and check its content, including the limits of the safety supervisor.

    Raises
    ------
    InputError
        The file cannot be read or is not a valid rig file; the message has one line per problem.
    """
    try:
        rig_file = read_rig_file(path)
    except FileNotFoundError as error:
        if path.name in offered(RIGS, tuple(sys.path)).names:
            raise InputError(
                f"rig {path.name!r}: a rig class of an installed package: expected a rig file "
                "(TOML), which this command needs"
            ) from error
        raise unreadable(path, error) from error
    except OSError as error:
        raise unreadable(path, error) from error
    except RigFileError as error:
        raise InputError(str(error)) from error
    try:
        rig_limits(rig_file.sections)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    return rig_file
