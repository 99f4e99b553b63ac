"""Find the header above the samples of a table, with or without a row of units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import zip_longest

from teleop.evaluation.formats.columns import split_heading
from teleop.evaluation.formats.table import Heading
from teleop.evaluation.formats.units import canonical, is_unit

NUMERIC = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)*|[.,]\d+)(?:[eEdD][-+]?\d+)?")
"""Pattern of a number with any decimal mark and separator of thousands."""
NOT_FINITE = re.compile(r"[-+]?(?:nan|inf|infinity)", re.IGNORECASE)


def is_number(cell: str) -> bool:
    """Return whether a cell contains a number, or a mark for a missing number such as NaN."""
    return bool(NUMERIC.fullmatch(cell) or NOT_FINITE.fullmatch(cell))


def is_samples(cells: Sequence[str]) -> bool:
    """Return whether at least two cells, and at least half of the filled cells, are numbers."""
    numbers = sum(map(is_number, cells))
    return numbers >= 2 and 2 * numbers >= sum(map(bool, cells))


def fitted(cells: list[str], width: int) -> list[str]:
    """Return a row without the empty cells at its end.

    The first `width` cells are never removed.
    """
    while len(cells) > width and not cells[-1]:
        cells = cells[:-1]
    return cells


def is_units(cells: Sequence[str]) -> bool:
    """Return whether a row of a table contains the units of the columns, such as `mm` and `N`.

    At least one cell must be a known unit. Of the cells that are not empty, at least half must be
    known units (or `-` or `%`), or at least half must begin with a bracket.
    """
    filled = [cell.strip("[]() ") for cell in cells if cell]
    brackets = sum(cell[:1] in ("[", "(") for cell in cells)
    known = sum(is_unit(cell) or cell in ("-", "%", "") for cell in filled)
    return any(map(is_unit, filled)) and 2 * max(known, brackets) >= len(filled)


def headings_above(rows: Sequence[list[str]], width: int) -> tuple[list[Heading], int] | None:
    """Return the name and unit of each column, from the rows above the samples of a table.

    The header is the row directly above the samples, or two rows: names, and below them units. The
    result is None if there is no header.
    """
    found = [fitted(row, 0) for row in rows[-2:]]
    if not found or not matches(found[-1], width):
        return None
    names, units = found[-1], [""] * width
    row = len(rows) - 1
    if len(found) == 2 and is_units(found[1]) and matches(found[0], width):
        (names, units), row = found, row - 1
    headings = []
    for name, unit in zip_longest(names, units[: len(names)], fillvalue=""):
        unit = unit.strip("[]() ")
        if not unit or unit == "-":
            headings.append(split_heading(name))
        else:
            headings.append(Heading(name, canonical(unit)))
    return headings, row


def matches(row: Sequence[str], width: int) -> bool:
    """Return whether a row can be the header of a table whose rows have `width` cells.

    The header must have 2 to `width` cells, and must not consist mainly of numbers.
    """
    return 2 <= len(row) <= width and not is_samples(row)
