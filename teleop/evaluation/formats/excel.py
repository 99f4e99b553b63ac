"""Read Excel workbooks and other spreadsheets."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from drivers.input_file import open_input
from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.dialect import Dialect
from teleop.evaluation.formats.layout import headings_above, is_number, is_samples
from teleop.evaluation.formats.table import Pick, Places, Table, missing, stated_filter

NUMBERS = Dialect(None, ".")
"""Dialect of numbers that are stored as text in a cell."""


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read one table from each sheet of a workbook. Other text may be above its header."""
    try:
        import python_calamine
    except ImportError as error:
        raise missing("python-calamine", "Excel") from error
    with open_input(path) as file:
        content = BytesIO(file.read())
    workbook = python_calamine.load_workbook(content)
    names = workbook.sheet_names
    sheets = {name: workbook.get_sheet_by_name(name).to_python() for name in names}
    tables = []
    for name, rows in sheets.items():
        table = table_in(f"{path}, sheet {name!r}", name, rows, pick)
        if table:
            tables.append(table)
    return tables


def table_in(where: str, name: str, rows: Sequence[Sequence[Any]], pick: Pick) -> Table | None:
    """Return a table of a sheet: the first table that contains the wanted columns.

    If no table contains the wanted columns, the longest table is returned. If the sheet has no
    table, the result is None.
    """
    cells = [[text_of(value) for value in row] for row in rows]
    best: Table | None = None
    start = 0
    while start < len(rows):
        if not is_samples(cells[start]):
            start += 1
            continue
        end = start
        while end < len(rows) and any(map(is_number, cells[end])):
            end += 1
        above = [i for i in range(start) if any(cells[i])][-2:]
        found = headings_above([cells[i] for i in above], len(cells[start]))
        if found:
            headings, row = found
            numbers = [i for i in range(start, end) if any(cells[i])]
            picked = sorted(pick(headings))
            columns = {k: np.full(len(numbers), np.nan) for k in picked}
            problem = None
            for n, i in enumerate(numbers):
                for k in picked:
                    try:
                        columns[k][n] = NUMBERS.number(cells[i][k])
                    except ValueError:
                        shown = repr(cells[i][k]) if cells[i][k] else "empty"
                        problem = problem or InputError(
                            f"{where}, row {i + 1}: {headings[k].title!r} is {shown}, "
                            "expected a number"
                        )
            header = above[row] + 1
            table = Table(
                f"{where}, row {header}",
                headings,
                columns,
                len(numbers),
                Places(f"{where}, row ", [i + 1 for i in numbers]),
                name,
                problem=problem,
            )
            stated = stated_filter(" ".join(row) for row in cells[:start])
            if stated:
                table.about["force_filter"] = stated
            if columns:
                return table
            if best is None or table.samples > best.samples:
                best = table
        start = end
    return best


def text_of(value: Any) -> str:
    """Convert the value of a cell to text.

    A date becomes the number of seconds since 1970, a time of day the number of seconds since
    midnight, and a duration its number of seconds.
    """
    if isinstance(value, datetime.datetime):
        return repr((value - datetime.datetime(1970, 1, 1)).total_seconds())
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    if isinstance(value, datetime.time):
        return repr(value.hour * 3600 + value.minute * 60 + value.second + value.microsecond * 1e-6)
    return repr(value) if isinstance(value, float) else str(value).strip()
