"""Build tables from the named arrays in a file of a binary format, such as HDF5 or MATLAB."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from teleop.evaluation.formats.columns import split_heading
from teleop.evaluation.formats.table import Heading, Pick, Places, Table
from teleop.evaluation.formats.units import canonical

if TYPE_CHECKING:
    from estimation.arrays import Floats

FEWEST = 3
"""Smallest number of samples in an array that becomes a column."""
WIDEST = 1000
"""Largest number of columns of a matrix that is split into columns."""


def vectors(name: str, value: Any, by_rows: bool = False) -> dict[str, Floats]:
    """Split an array into columns of samples, and return the columns by name.

    A vector is one column, with the name of the array. The columns of a matrix have the names
    `name[1]`, `name[2]`, and so on. The result is empty if the array cannot contain samples, for
    example because it contains text or too few values. Dates are converted to the time since the
    first sample [s]. With `by_rows`, a signal is a row of the matrix, as in HDF5 files of MATLAB.
    """
    array = np.asarray(value)
    if array.dtype.kind == "M":
        array = (array - array.reshape(-1)[:1]) / np.timedelta64(1, "s")
    elif array.dtype.kind == "m":
        array = array / np.timedelta64(1, "s")
    if not can_be_columns(array.shape, array.dtype.kind):
        return {}
    array = np.squeeze(array)
    if array.ndim == 1:
        return {name: array}
    columns = array if by_rows else array.T
    if len(columns) > WIDEST or columns.shape[1] < FEWEST:
        return {}
    return {f"{name}[{i}]": column for i, column in enumerate(columns, 1)}


def can_be_columns(shape: Sequence[int], kind: str) -> bool:
    """Return whether an array of this shape and kind of elements can be a vector or matrix.

    `kind` is the attribute of numpy's dtype: numbers, truth values, dates and durations.
    """
    long = [count for count in shape if count != 1]
    return kind in "fiubmM" and 1 <= len(long) <= 2 and math.prod(long) >= FEWEST


def heading(name: str, unit: Any = None) -> Heading:
    """Return the heading of a column: its name and its unit."""
    if isinstance(unit, bytes):
        unit = unit.decode(errors="replace")
    if isinstance(unit, str) and unit.strip() not in ("", "-"):
        return Heading(name, canonical(unit.strip("[]() ")))
    return split_heading(name)


def table_of(
    path: Path,
    where: str,
    columns: Mapping[str, Floats],
    pick: Pick,
    units: Mapping[str, Any],
    title: str = "",
    about: Mapping[str, str] | None = None,
) -> Table:
    """Build a table from arrays of equal length."""
    headings = [heading(name, units.get(name)) for name in columns]
    arrays = list(columns.values())
    picked = {i: np.asarray(arrays[i], dtype=np.float64) for i in pick(headings)}
    samples = len(arrays[0]) if arrays else 0
    return Table(
        where,
        headings,
        picked,
        samples,
        Places(f"{where}, sample ", range(1, samples + 1)),
        title,
        dict(about or {}),
    )


def tables_by_length(
    path: Path,
    columns: Mapping[str, Floats],
    pick: Pick,
    units: Mapping[str, Any],
    about: Mapping[str, str] | None = None,
) -> list[Table]:
    """Divide the arrays of a file into tables: all arrays of equal length form one table.

    The parameters are those of `table_of`, but the arrays in `columns` can have different lengths.
    """
    lengths: dict[int, dict[str, Floats]] = {}
    for name, column in columns.items():
        lengths.setdefault(len(column), {})[name] = column
    return [table_of(path, str(path), some, pick, units, "", about) for some in lengths.values()]


def tables_by_group(
    path: Path,
    groups: Mapping[str, Mapping[str, Floats]],
    pick: Pick,
    units: Mapping[str, Mapping[str, Any]],
    about: Mapping[str, str] | None = None,
) -> list[Table]:
    """Build the tables of a file in which the arrays are divided into groups.

    In each group, all arrays of equal length form one table. The title of the table is the name of
    the group.
    """
    tables = []
    for group, columns in groups.items():
        for table in tables_by_length(path, columns, pick, units.get(group, {}), about):
            table.title = group
            tables.append(table)
    return tables


def texts(values: Mapping[str, Any], names: Sequence[str]) -> dict[str, str]:
    """Return the texts among some values, by name."""
    found = {}
    for name in names:
        value = values.get(name)
        if isinstance(value, bytes):
            value = value.decode(errors="replace")
        if isinstance(value, np.ndarray) and value.size == 1:
            value = value.reshape(-1)[0]
        if isinstance(value, str):
            found[name] = str(value)
    return found
