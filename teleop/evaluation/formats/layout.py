"""Where the header of a table stands: above the samples, with a row of units below it or not."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import zip_longest

from teleop.evaluation.formats.columns import split_heading
from teleop.evaluation.formats.table import Heading
from teleop.evaluation.units import canonical, is_unit

NUMERIC = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)*|[.,]\d+)(?:[eEdD][-+]?\d+)?")
"""A number with any decimal mark and separator of thousands."""
NOT_FINITE = re.compile(r"[-+]?(?:nan|inf|infinity)", re.IGNORECASE)


def is_number(cell: str) -> bool:
    """Whether a cell has a number, or says that it has none."""
    return bool(NUMERIC.fullmatch(cell) or NOT_FINITE.fullmatch(cell))


def is_samples(cells: Sequence[str]) -> bool:
    """Whether a row has numbers in at least two cells, and in half of those that are filled."""
    numbers = sum(map(is_number, cells))
    return numbers >= 2 and 2 * numbers >= sum(map(bool, cells))


def fitted(cells: list[str], width: int) -> list[str]:
    """A row without the empty cells at its end that are beyond the header's width."""
    while len(cells) > width and not cells[-1]:
        cells = cells[:-1]
    return cells


def is_units(cells: Sequence[str]) -> bool:
    """Whether a row below the names has their units."""
    filled = [cell.strip("[]() ") for cell in cells if cell]
    brackets = sum(cell[:1] in ("[", "(") for cell in cells)
    known = sum(is_unit(cell) or cell in ("-", "%", "") for cell in filled)
    return any(map(is_unit, filled)) and 2 * max(known, brackets) >= len(filled)


def headings_above(rows: Sequence[list[str]], width: int) -> tuple[list[Heading], int] | None:
    """The headings of samples, from the rows above them; None where there is no header.

    Parameters
    ----------
    rows
        Rows that are not empty, of which the last is directly above the samples.
    width
        Number of cells of the samples.

    Returns
    -------
    The headings, and which of the rows has the names.
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
    """Whether a row may be the header of samples of this width, or of fewer columns."""
    return 2 <= len(row) <= width and not is_samples(row)
