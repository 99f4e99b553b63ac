"""Read the numbers in the lines of a text table.

Successive lines with the same number of cells are converted together, which is faster than line by
line.
"""

from __future__ import annotations

import csv
import re
from array import array
from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from teleop.errors import InputError
from teleop.evaluation.formats.dialect import Dialect
from teleop.evaluation.formats.layout import fitted, is_number
from teleop.evaluation.formats.table import Heading

QUOTED = re.compile(r'"[^"\n]*"')
ODD = 64
"""If the lines of a block cannot be converted together, the block is halved, and each half is tried
again. If a half would have fewer lines than this number, the block is read line by line."""


def count_cells(line: str, delimiter: str | None) -> int:
    """Return the number of cells in a line that contains no quotes."""
    return line.count(delimiter) + 1 if delimiter else len(line.split())


class NumberReader:
    """Reader of the samples of one table in a text file. It stores the columns to load."""

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
        """Read the samples in the next lines, and return how many of the lines belong to the table.

        The table ends before the first line that contains text but no number. A line is invalid if
        it has a different number of cells than the header, or text in a column to load. After an
        empty line, an invalid line ends the table. Otherwise, the attribute `problem` is set to an
        error for the invalid line.
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
        """Convert many lines together, and return the values of the columns to load, shape (n, m).

        The result is None if at least one of the n lines is invalid, empty or a comment, or has
        marks that require `_row`, such as a separator of thousands.
        """
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
        """Return the values of the columns to load in one line; None if the line has no number."""
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
        """Convert a cell to a number."""
        try:
            return self._dialect.number(cell)
        except ValueError:
            title = self.headings[column].title
            shown = f"{cell!r}, expected a number" if cell else "empty, expected a finite number"
            raise InputError(f"{where}: {title!r} is {shown}") from None

    def _skip(self, lines: list[str]) -> int:
        """Return how many of the lines belong to the table, without reading their values.

        This is used for a table without columns to load, and after an invalid line. The table ends
        before the first line that contains text but no number.
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
        """Number of samples that were read so far.

        If the table has no columns to load, it is the number of lines.
        """
        return sum(map(len, self._numbers))

    def columns(self) -> dict[int, Floats]:
        """Return the loaded columns, each of shape (n,), by the index of the column."""
        if not self._values:
            return {i: np.empty(0) for i in self.picked}
        values = np.concatenate(self._values)
        self._values = [values]
        return {i: np.ascontiguousarray(values[:, k]) for k, i in enumerate(self.picked)}

    def numbers(self) -> NDArray[np.int64]:
        """Return for each sample the number of its line in the file, shape (n,)."""
        return np.concatenate(self._numbers) if self._numbers else np.empty(0, dtype=np.int64)
