"""Find the rig class of another package by its name, for `teleop run --rig NAME`."""

from __future__ import annotations

import sys
from pathlib import Path

from drivers import Rig
from drivers.registry import RIGS, checked_class, offered
from teleop.errors import InputError, as_input_error


def rig_class(rig: Path | None) -> type[Rig] | None:
    """Return the rig class with a name; None for a rig file or the simulated rig.

    A path that exists is a rig file, and so is a path with a folder or an ending.

    Raises
    ------
    InputError
        No package has a rig class with this name, or the class cannot be used.
    """
    if rig is None or rig.exists() or rig.name != str(rig) or rig.suffix:
        return None
    names = offered(RIGS, tuple(sys.path)).names
    if rig.name not in names:
        known = f", or one of {', '.join(sorted(names))}" if names else ""
        raise InputError(f"rig {rig.name!r}: no such file: expected a rig file{known}")
    with as_input_error():
        found: type[Rig] = checked_class(RIGS, rig.name, {}, Rig)
    return found
