"""Write the tables of results of a sweep, with a row for each estimator at each point."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from estimation.quantities import RESULTS as QUANTITIES
from teleop.errors import InputError
from teleop.files import new_file, unwritable
from teleop.json_documents import dumps
from teleop.studies.json_lines import JsonLines
from teleop.studies.series.table import RESULT_COLUMNS
from teleop.studies.sweep.points import Point
from teleop.studies.sweep.tasks import ESTIMATOR, Row, Task

if TYPE_CHECKING:
    from teleop.output.sweep_figures import SweepRows


CSV, PARQUET = "results.csv", "results.parquet"
BATCH = 10_000
"""Number of rows that are written to the Parquet file together."""


class Tables:
    """Writes the tables of results of a sweep: results.csv and results.parquet.

    The file results.csv is written while the sweep runs. The file results.parquet is written by the
    method `write_parquet`.
    """

    def __init__(
        self,
        folder: Path,
        task: Task,
        points: Sequence[Point],
        journal: JsonLines,
        positions: Mapping[int, int],
    ) -> None:
        self._folder, self._task, self._points = folder, task, points
        self._journal, self._positions = journal, positions
        self._names = columns_of(task)
        self._written = 0
        """Number of points whose rows are in the table."""
        self._write("w", [dict(zip(self._names, self._names, strict=True))])
        self.extend()

    def extend(self) -> None:
        """Append the points that are done to results.csv, up to the first one that is not done."""
        start = self._written
        while self._written < len(self._points) and self._next in self._positions:
            self._written += 1
        if self._written > start:
            self._write("a", self.rows(start, self._written))

    @property
    def _next(self) -> int:
        return self._points[self._written].number

    def _write(self, mode: Literal["w", "a"], rows: Iterable[Row]) -> None:
        """Write rows to results.csv, which is new (`mode` "w"), or at its end (`mode` "a")."""
        path = self._folder / CSV
        try:
            with path.open(mode, newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, self._names, restval="")
                for row in rows:
                    writer.writerow({name: as_text(value) for name, value in row.items()})
        except OSError as error:
            raise unwritable(path, error) from error

    def rows(self, start: int, end: int) -> Iterator[Row]:
        """Yield the rows of the points `start` to `end` - 1, or a row with the error of a point."""
        points = self._points[start:end]
        results = self._journal.documents_at(self._positions[point.number] for point in points)
        for point, result in zip(points, results, strict=True):
            about = {
                "point": point.number,
                **dict(zip(self._task.keys, point.values, strict=True)),
                "repetition": point.repetition,
            }
            problem = result.get("stopped") or result.get("error", "no estimate")
            for row in result.get("rows") or [{"error": problem}]:
                yield {**about, **row}

    def write_parquet(self) -> bool:
        """Write results.parquet. Return False if pyarrow is not installed."""
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            return False
        kinds = {"point": pyarrow.int64(), "repetition": pyarrow.int64(), "seed": pyarrow.int64()}
        kinds |= {"estimator": pyarrow.string(), "error": pyarrow.string()}
        for i, key in enumerate(self._task.keys):
            numbers = all(is_number(point.values[i]) for point in self._points)
            kinds[key] = pyarrow.float64() if numbers else pyarrow.string()
        schema = pyarrow.schema(
            [(name, kinds.get(name, pyarrow.float64())) for name in self._names]
        )
        text = {name for name in self._names if schema.field(name).type == pyarrow.string()}
        every = self.rows(0, self._written)
        with (
            new_file(self._folder / PARQUET, overwrite=True) as file,
            parquet.ParquetWriter(file, schema) as writer,
        ):
            for first in every:
                batch = [
                    {name: as_text(row[name]) if name in text else row[name] for name in row}
                    for row in chain([first], islice(every, BATCH - 1))
                ]
                writer.write_table(pyarrow.Table.from_pylist(batch, schema))
        return True


def columns_of(task: Task) -> list[str]:
    """Return the names of the columns in the tables of results of a sweep, in their order."""
    names = ("point", *task.keys, "repetition", *task.columns, "error")
    return [*dict.fromkeys(names)]


def is_number(value: Any) -> bool:
    """Return whether a value is a number. True and False are not treated as numbers."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def as_text(value: Any) -> str | None:
    """Return a value as in a CSV cell: texts and numbers as they are, others as JSON."""
    if value is None or isinstance(value, str):
        return value
    return str(value) if isinstance(value, int | float) else dumps(value)


def read_rows(path: Path, factors: Sequence[str], response: str) -> SweepRows:
    """Return those rows of a table of results that contain a value of the result `response`."""
    from teleop.output.sweep_figures import SweepRows  # imports matplotlib, which takes long

    heading = RESULT_COLUMNS[response]
    with path.open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if math.isfinite(float(row[heading] or "nan"))]
    if not rows:
        raise InputError(f"{path}: no point has a value of {heading}: nothing to plot")
    # The table has SI units, the figure the unit in which the quantity is shown.
    quantity = QUANTITIES.get(response)
    return SweepRows(
        {name: values_of([row[name] for row in rows]) for name in factors},
        np.array([row[ESTIMATOR] for row in rows]),
        np.array([float(row[heading]) for row in rows]) * (quantity.factor if quantity else 1.0),
        quantity.heading if quantity else heading,
    )


def values_of(cells: Sequence[str]) -> Sequence[float] | Sequence[str]:
    """Return the values of a column as numbers, or as texts if one of them is not a number."""
    try:
        return [float(cell) for cell in cells]
    except ValueError:
        return cells
