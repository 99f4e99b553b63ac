"""Read HDF5 files, and MATLAB files of version 7.3, which are also HDF5 files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers.input_file import open_input
from teleop.errors import InputError
from teleop.evaluation.formats.arrays import (
    can_be_columns,
    tables_by_group,
    tables_by_length,
    texts,
    vectors,
)
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Pick, Table, missing
from teleop.json_documents import dumps

if TYPE_CHECKING:
    from estimation.arrays import Floats

UNIT = ("unit", "units", "Unit", "Units")
"""Usual names of the attribute that contains the unit of a dataset."""
SHOWN = 3
"""Largest number of datasets that a message lists."""


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read an HDF5 file. In each group, the datasets of the same length become one table.

    The unit of a dataset is read from an attribute of the dataset (see `UNIT`).
    """
    groups: dict[str, dict[str, Floats]] = {}
    units: dict[str, dict[str, Any]] = {}
    with open_input(path) as disk, opened(disk) as file:
        found = Datasets(file)
        for name, dataset in found:
            group, _, last = name.rpartition("/")
            if dataset.dtype.names:
                for field in dataset.dtype.names:
                    groups.setdefault(name, {}).update(vectors(field, dataset[field]))
                continue
            if not can_be_columns(dataset.shape, dataset.dtype.kind):
                continue
            unit = next((dataset.attrs[key] for key in UNIT if key in dataset.attrs), None)
            for column, values in vectors(last, dataset[()]).items():
                groups.setdefault(group, {})[column] = values
                units.setdefault(group, {})[column] = unit
        about = texts(dict(file.attrs), ("settings", "force_filter"))
        about["session"] = dumps(texts(dict(file.attrs), list(file.attrs)))
        if "events" in file and file["events"].dtype.kind == "O":
            about["events"] = "[" + ",".join(event.decode() for event in file["events"]) + "]"
    return found.noted(path, tables_by_group(path, groups, pick, units, about))


def read_matlab(path: Path, pick: Pick) -> list[Table]:
    """Read a MATLAB file of version 7.3, which is an HDF5 file.

    The tables and their units are found as in the other versions
    (`teleop.evaluation.formats.matlab.read`).
    """
    columns: dict[str, Floats] = {}
    units: dict[str, Any] = {}
    with open_input(path) as disk, opened(disk) as file:
        found = Datasets(file)
        for name, dataset in found:
            if name.startswith("#"):
                continue
            name = name.replace("/", ".")
            if dataset.attrs.get("MATLAB_class") == b"char":
                parts = name.split(".")
                if len(parts) > 1 and parts[-2].lower() in ("unit", "units"):
                    field = ".".join([*parts[:-2], parts[-1]])
                    units[field] = "".join(map(chr, np.ravel(dataset[()])))
            elif can_be_columns(dataset.shape, dataset.dtype.kind):
                columns.update(vectors(name, dataset[()], by_rows=True))
    return found.noted(path, tables_by_length(path, columns, pick, units))


def opened(disk: Any) -> Any:
    """Return the `h5py.File` of an HDF5 file that is already open as a binary file (`disk`)."""
    try:
        import h5py
    except ImportError as error:
        raise missing("h5py", "HDF5") from error
    return h5py.File(disk, "r")


class Datasets:
    """Iterate over the name and the content of each dataset of an HDF5 file, in its order.

    A group to which several links lead is searched once. Datasets whose values are in other files
    are left out: a file should not cause the program to open others, which can be FIFOs or devices.
    """

    def __init__(self, file: Any) -> None:
        self._file = file
        self._elsewhere: list[str] = []

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        yield from self._within(self._file, "", {self._file["/"]})

    def _within(self, group: Any, prefix: str, searched: set[Any]) -> Iterator[tuple[str, Any]]:
        import h5py

        for key in group:
            name = prefix + key
            if isinstance(group.get(key, getlink=True), h5py.ExternalLink):
                self._elsewhere.append(name)
                continue
            item = group.get(key)  # None for a link that leads to nothing
            if isinstance(item, h5py.Dataset) and item.shape is not None:
                if item.external or (
                    item.is_virtual and any(s.file_name != "." for s in item.virtual_sources())
                ):
                    self._elsewhere.append(name)
                else:
                    yield name, item
            elif isinstance(item, h5py.Group) and item not in searched:
                searched.add(item)
                yield from self._within(item, f"{name}/", searched)

    def noted(self, path: Path, tables: list[Table]) -> list[Table]:
        """Return the tables of the file, with a note about the datasets that were left out."""
        if self._elsewhere:
            more = ", ..." if len(self._elsewhere) > SHOWN else ""
            names = ", ".join(map(repr, self._elsewhere[:SHOWN])) + more
            if not tables:
                raise InputError(f"{path}: {names}: in other files, expected data in this file")
            for table in tables:
                table.notes = (f"{names}: in other files, left out",)
        return tables
