"""MATLAB files: version 5 to 7 by scipy; version 7.3 is HDF5."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from drivers.input_file import open_input
from estimation.compiled import Floats
from teleop.evaluation.formats import hdf5
from teleop.evaluation.formats.arrays import tables_by_length, texts, vectors
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Pick, Table, reading
from teleop.json_documents import dumps

EXPORTED = ("settings", "events")
"""Variables of an export of ours that are text."""


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """The tables in a MATLAB file: arrays of one length, also within structs.

    A field `units` of the file, or of a struct, has the unit of each array by its name.
    """
    with open_input(path) as file:
        if file.read(10) == b"MATLAB 7.3":
            return hdf5.read_matlab(path, pick)
        file.seek(0)
        from scipy.io import loadmat

        with reading(path, "a MATLAB file"):
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
    """Take in the arrays and the units of a variable or a struct."""
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
