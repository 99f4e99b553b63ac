"""Read MATLAB files: versions 5 to 7 with scipy, and version 7.3 as HDF5."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers.input_file import open_input
from teleop.evaluation.formats import hdf5
from teleop.evaluation.formats.arrays import tables_by_length, texts, vectors
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Pick, Table
from teleop.json_documents import dumps

if TYPE_CHECKING:
    from estimation.arrays import Floats

EXPORTED = ("settings", "events")
"""Text variables that `teleop export` writes to a MATLAB file."""


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read a MATLAB file. Arrays of the same length, also those in structs, become one table.

    The units are read from a struct with the name `units`, if the file contains one. For each
    array, it has a field with the name of the array, which contains the unit. If arrays are fields
    of a struct, this struct can contain a struct `units` for these arrays.
    """
    with open_input(path) as file:
        if file.read(10) == b"MATLAB 7.3":
            return hdf5.read_matlab(path, pick)
        file.seek(0)
        from scipy.io import loadmat

        content = loadmat(file, squeeze_me=True, simplify_cells=True)
    columns: dict[str, Floats] = {}
    units: dict[str, Any] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            collect(name, value, columns, units)
    about = texts(content, EXPORTED)
    if isinstance(session := content.get("session"), dict):
        about["session"] = dumps(texts(session, list(session)))
    return tables_by_length(path, columns, pick, units, about)


def collect(name: str, value: Any, columns: dict[str, Floats], units: dict[str, Any]) -> None:
    """Add the arrays in a variable of a MATLAB file to `columns`, and their units to `units`."""
    if not isinstance(value, dict):
        columns.update(vectors(name, value))
        return
    group, _, last = name.rpartition(".")
    if last.lower() in ("unit", "units"):
        prefix = f"{group}." if group else ""
        units.update({prefix + field: unit for field, unit in value.items()})
    for field, item in value.items():
        if isinstance(item, (dict, np.ndarray)):
            collect(f"{name}.{field}", item, columns, units)
