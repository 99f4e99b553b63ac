"""Read HDF5 files, and MATLAB files of version 7.3, which are also HDF5 files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from drivers.input_file import open_input
from estimation.compiled import Floats
from teleop.evaluation.formats.arrays import (
    tables_by_group,
    tables_by_length,
    texts,
    vectors,
)
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Pick, Table, missing, reading
from teleop.json_documents import dumps

UNIT = ("unit", "units", "Unit", "Units")
"""Usual names of the attribute that contains the unit of a dataset."""


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read an HDF5 file. In each group, the datasets of the same length become one table.

    The unit of a dataset is read from an attribute of the dataset (see `UNIT`).
    """
    groups: dict[str, dict[str, Floats]] = {}
    units: dict[str, dict[str, Any]] = {}
    with open_input(path) as disk, reading(path, "HDF5"), opened(disk) as file:
        for name, dataset in datasets(path, file):
            group, _, last = name.rpartition("/")
            if dataset.dtype.names:
                for field in dataset.dtype.names:
                    groups.setdefault(name, {}).update(vectors(field, dataset[field]))
                continue
            unit = next((dataset.attrs[key] for key in UNIT if key in dataset.attrs), None)
            for column, values in vectors(last, dataset[()]).items():
                groups.setdefault(group, {})[column] = values
                units.setdefault(group, {})[column] = unit
        about = texts(dict(file.attrs), ("settings", "force_filter"))
        about["session"] = dumps(texts(dict(file.attrs), list(file.attrs)))
        if "events" in file and file["events"].dtype.kind == "O":
            about["events"] = "[" + ",".join(event.decode() for event in file["events"]) + "]"
    return tables_by_group(path, groups, pick, units, about)


def read_matlab(path: Path, pick: Pick) -> list[Table]:
    """Read a MATLAB file of version 7.3, which is an HDF5 file.

    The tables and their units are found as in the other versions
    (`teleop.evaluation.formats.matlab.read`).
    """
    columns: dict[str, Floats] = {}
    units: dict[str, Any] = {}
    with open_input(path) as disk, reading(path, "HDF5"), opened(disk) as file:
        for name, dataset in datasets(path, file):
            if name.startswith("#"):
                continue
            name = name.replace("/", ".")
            value = dataset[()]
            if dataset.attrs.get("MATLAB_class") == b"char":
                parts = name.split(".")
                if len(parts) > 1 and parts[-2].lower() in ("unit", "units"):
                    field = ".".join([*parts[:-2], parts[-1]])
                    units[field] = "".join(map(chr, np.ravel(value)))
                continue
            columns.update(vectors(name, value, by_rows=True))
    return tables_by_length(path, columns, pick, units)


def opened(disk: Any) -> Any:
    """Return the `h5py.File` of an HDF5 file that is already open as a binary file (`disk`).

    Raises
    ------
    InputError
        h5py is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise missing("h5py", "HDF5") from error
    return h5py.File(disk, "r")


def datasets(path: Path, group: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the path and the content of each dataset in a group, in the order of the file.

    Groups within the group are searched too.

    Parameters
    ----------
    path
        The file.
    group
        The group to search, or the whole file.
    prefix
        Start of the paths: the path of `group` within the file, with `/` at its end.
    """
    import h5py

    for name, item in group.items():
        if isinstance(item, h5py.Dataset):
            yield prefix + name, item
        elif isinstance(item, h5py.Group):
            yield from datasets(path, item, f"{prefix}{name}/")
