"""Read the numbers in the lines of a text table. Lines of the same form are read together."""

from __future__ import annotations

import csv
import re
from array import array
from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.evaluation.formats.dialect import Dialect
from teleop.evaluation.formats.layout import fitted, is_number
from teleop.evaluation.formats.table import Heading

QUOTED = re.compile(r'"[^"\n]*"')
ODD = 64
"""A block of lines with different forms is halved if its halves have at least this many lines.
Otherwise, the block is read line by line."""


def count_cells(line: str, delimiter: str | None) -> int:
    """Return the number of cells in a line that contains no quotes."""
    return line.count(delimiter) + 1 if delimiter else len(line.split())


class Rows:
    """Reader of the picked columns of a table.

    Parameters
    ----------
    place
        Function for error messages. It takes the number of a line, and returns a text with the
        name of the file and this number.
    headings
        Name and unit of each column.
    picked
        Indices of the columns to load.
    dialect
        Delimiter, decimal mark and separator of thousands.
    """

    def __init__(
        self,
        place: Callable[[int], str],
        headings: Sequence[Heading],
        picked: Collection[int],
        dialect: Dialect,
    ) -> None:
        self.headings = headings
        self.picked = sorted(picked)
        self.problem: InputError | None = None
        self._place, self._dialect = place, dialect
        self._parted = False  # by an empty line
        self._values: list[Floats] = []
        self._numbers: list[NDArray[np.int64]] = []

    def feed(self, first: int, lines: list[str]) -> int:
        """Process lines, and return how many of these lines belong to the table.

        A line without any number ends the table. After an empty line, an invalid line also ends the
        table.

        Parameters
        ----------
        first
            Number of the first line in the file.
        lines
            The lines.
        """
        if not self.picked or self.problem:
            return self._skip(lines)
        values = self._in_bulk(lines)
        if values is not None:
            self._parted = False
            self._values.append(values)
            self._numbers.append(np.arange(first, first + len(lines), dtype=np.int64))
            return len(lines)
        half = len(lines) // 2
        if half >= ODD:
            taken = self.feed(first, lines[:half])
            return taken if taken < half else half + self.feed(first + half, lines[half:])
        samples, numbers = array("d"), array("q")
        taken = len(lines)
        for i, line in enumerate(lines):
            if not line or line.isspace() or line.startswith("#"):
                self._parted = self._parted or not line.strip()
                continue
            try:
                row = self._row(first + i, line)
            except InputError as error:
                if self._parted and self.samples + len(numbers):
                    taken = i
                    break
                self.problem = error
                break
            if row is None:
                taken = i
                break
            self._parted = False
            samples.extend(row)
            numbers.append(first + i)
        self._values.append(np.array(samples).reshape(-1, len(self.picked)))
        self._numbers.append(np.array(numbers, dtype=np.int64))
        return self._skip(lines) if self.problem else taken

    def _in_bulk(self, lines: list[str]) -> Floats | None:
        """Return the values of lines if all have the same valid form; otherwise None."""
        delimiter, decimal, thousands = self._dialect
        width = len(self.headings)
        text = "\n".join(lines)
        bare = lines
        if '"' in text:
            bare = QUOTED.sub("0", text).split("\n")
        cells = {count_cells(line, delimiter) for line in bare}
        if cells == {width + 1} and delimiter:
            if not all(line.rstrip(" ").endswith(delimiter) for line in bare):
                return None
        elif cells != {width}:
            return None
        foreign = {"#", thousands or "#"} - {delimiter}
        if any(mark in text for mark in foreign):
            return None
        if decimal == "," != delimiter and "," in text:
            lines = text.replace(",", ".").split("\n")
        try:
            values: Floats = np.loadtxt(
                lines,
                delimiter=delimiter,
                usecols=self.picked,
                comments=None,
                quotechar='"' if delimiter else None,
                ndmin=2,
            )
        except ValueError:
            return None
        return values if len(values) == len(lines) else None

    def _row(self, number: int, line: str) -> list[float] | None:
        """Return the picked values of a line; None for a line without any number."""
        where = self._place(number)
        try:
            cells = fitted(self._dialect.split(line), len(self.headings))
        except csv.Error as error:
            raise InputError(f"{where}: cannot be read as a table: {error}") from error
        if not any(map(is_number, cells)):
            return None
        if len(cells) != len(self.headings):
            raise InputError(
                f"{where}: {len(cells)} cells, expected {len(self.headings)} as in the header"
            )
        return [self._value(where, cells[i], i) for i in self.picked]

    def _value(self, where: str, cell: str, column: int) -> float:
        """Convert a cell to a number; `where` and `column` are used in the error message."""
        try:
            return self._dialect.number(cell)
        except ValueError:
            title = self.headings[column].title
            shown = f"{cell!r}, expected a number" if cell else "empty, expected a finite number"
            raise InputError(f"{where}: {title!r} is {shown}") from None

    def _skip(self, lines: list[str]) -> int:
        """Return how many of the lines belong to a table whose values are not needed.

        The table ends at the first line that contains text but no number.
        """
        taken = len(lines)
        for i, line in enumerate(lines):
            if not line or line.isspace() or line.startswith("#"):
                continue
            try:
                cells = self._dialect.split(line)
            except csv.Error:
                cells = []
            if not any(map(is_number, cells)):
                taken = i
                break
        self._numbers.append(np.zeros(taken, dtype=np.int64))
        return taken

    @property
    def samples(self) -> int:
        """Number of samples that were read so far."""
        return sum(map(len, self._numbers))

    def columns(self) -> dict[int, Floats]:
        """Return the picked columns, by the index of the column, as arrays of shape (n,)."""
        if not self._values:
            return {i: np.empty(0) for i in self.picked}
        values = np.concatenate(self._values)
        self._values = [values]
        return {i: np.ascontiguousarray(values[:, k]) for k, i in enumerate(self.picked)}

    def numbers(self) -> NDArray[np.int64]:
        """Return the number of the line of each sample, shape (n,)."""
        return np.concatenate(self._numbers) if self._numbers else np.empty(0, dtype=np.int64)
