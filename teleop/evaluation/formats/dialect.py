"""Determine the dialect of a text table: delimiter, decimal mark and separator of thousands."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from typing import NamedTuple

from teleop.evaluation.formats.layout import is_number, is_samples

DELIMITERS = ("\t", ";", ",", "|", None)
"""Delimiters between cells, in the order in which they are tried; None for spaces."""

HEAD = 1000
"""Number of lines from which the dialect is determined."""


CLOCK = re.compile(r"(\d+):(\d\d):(\d\d(?:[.,]\d+)?)")


def clock(cell: str) -> float:
    """Convert a time of day to seconds since midnight, or an ISO date to seconds since 1970."""
    if match := CLOCK.fullmatch(cell):
        hours, minutes, seconds = (float(part.replace(",", ".")) for part in match.groups())
        return 3600.0 * hours + 60.0 * minutes + seconds
    date = datetime.fromisoformat(cell)
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def is_clock(cell: str) -> bool:
    """Return whether a cell contains a time of day, or a date with a time of day (see `clock`)."""
    try:
        return ":" in cell and clock(cell) >= 0.0
    except ValueError:
        return False


class Dialect(NamedTuple):
    """Delimiter, decimal mark and separator of thousands of a text table."""

    delimiter: str | None
    """Character that separates cells; None for spaces."""
    decimal: str = "."
    """Decimal mark. If it is a comma, a point is also accepted, unless the point separates
    thousands."""
    thousands: str | None = None
    """Separator of thousands; None if there is no separator."""

    def split(self, line: str) -> list[str]:
        """Split a line into cells."""
        if self.delimiter is None:
            return line.split()
        if '"' not in line and len(line) < csv.field_size_limit():
            return [cell.strip() for cell in line.split(self.delimiter)]
        return [cell.strip() for cell in next(csv.reader([line], delimiter=self.delimiter), [])]

    def number(self, cell: str) -> float:
        """Convert a cell to a number. A time, or a date with a time, becomes seconds (`clock`)."""
        if "_" in cell:
            raise ValueError(cell)
        if ":" in cell:
            return clock(cell)
        if self.thousands and self.thousands in cell:
            mark = re.escape(self.thousands)
            if not re.match(rf"[-+]?\d{{1,3}}({mark}\d{{3}})+(?!\d)", cell):
                raise ValueError(cell)
            cell = cell.replace(self.thousands, "")
        return float(cell.replace(",", ".") if self.decimal == "," else cell)


def dialect_of(lines: Sequence[str]) -> Dialect:
    """Return the dialect (delimiter, decimal mark, separator of thousands) of a text table.

    Each delimiter in `DELIMITERS` is tried, and the delimiter with the largest score is chosen. For
    the score, only the lines that consist mainly of numbers (`is_samples`) are considered. The
    score is the product of two values:

    - the number of these lines that have as many cells as the line before them;
    - the fraction of the filled cells that are numbers.
    """
    lines = [line for line in lines[:HEAD] if line.strip() and not line.startswith("#")]
    best, dialect = (0.0, 0.0), None
    for delimiter in DELIMITERS:
        try:
            rows = [Dialect(delimiter).split(line) for line in lines]
        except csv.Error:
            continue
        rows = [cells for cells in rows if is_samples(cells)]
        filled = sum(bool(cell) for cells in rows for cell in cells)
        numbers = [cell for cells in rows for cell in cells if is_number(cell)]
        alike = sum(len(a) == len(b) for a, b in pairwise(rows)) + bool(rows)
        score = (alike * len(numbers) / max(filled, 1), float(len(numbers)))
        if score > best:
            best, dialect = score, Dialect(delimiter, *marks(numbers, delimiter))
    first = lines[0] if lines else ""
    return dialect or Dialect(max("\t;,", key=first.count), ",")


def marks(numbers: Sequence[str], delimiter: str | None) -> tuple[str, str | None]:
    """Return the decimal mark and the separator of thousands of a table.

    `delimiter`: None for spaces.

    One of them is the point, and the other one is the comma. If the separator of thousands cannot
    be determined, the result is a comma and None. `Dialect.number` then accepts both the comma and
    the point as decimal mark.
    """
    both = [cell for cell in numbers if "," in cell and "." in cell]
    if both:
        return (".", ",") if both[0].rfind(".") > both[0].rfind(",") else (",", ".")
    point, comma = (any(mark in cell for cell in numbers) for mark in ".,")
    if point and comma:
        grouped = all(re.fullmatch(r"[-+]?\d{1,3}(,\d{3})+", c) for c in numbers if "," in c)
        return (".", ",") if grouped else (",", None)
    if comma:
        return ",", "."
    return (".", ",") if point or delimiter == "," else (",", None)
