"""Find the columns of time, position and force in a measurement table, and their units."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from teleop.errors import InputError
from teleop.evaluation.formats.names import KNOWN, NAMES, plain
from teleop.evaluation.formats.table import Heading
from teleop.evaluation.formats.units import ON_LEVER, UNITS, canonical, is_unit, size_of

SHOWN = 6
"""Largest number of usual names, and of columns, that an error message lists."""
COLUMNS_SHOWN = 24
AXES = frozenset("xyz0123456789")
"""A single character of these, in brackets after a column name, is an axis and not a unit."""


NUMBERED = re.compile(r" ?\d$")
"""Number of the sensor at the end of a column name such as `Load 1`."""
MASTER = ("_", "m")
"""Separator and suffix in the names of the channels of a master, such as `position_m`. This suffix
is not a unit."""


class Wanted(NamedTuple):
    """Options with which the user selects and converts the columns of a measurement file.

    An option that is None is not stated.
    """

    position: str | None = None
    """Column of the position: NAME, NAME=UNIT, or its number from 1."""
    force: str | None = None
    """Column of the force: NAME, NAME=UNIT, or its number from 1."""
    time: str | None = None
    """Column of the time: NAME, NAME=UNIT, or its number from 1."""
    block: int | None = None
    """Number of the table, from 1, in a file with several tables."""
    rate: float | None = None
    """Sampling rate of a file without a time column [Hz]."""
    lever: float | None = None
    """Lever arm that converts an angle and a torque to a position and a force [m]."""
    invert: str | None = None
    """Quantity whose sign is changed: `position`, `force` or `both`."""
    topic: str | None = None
    """Topic to read from a file of recorded messages, such as a ROS bag."""


class Column(NamedTuple):
    """A column of time, position or force in a table, and its conversion to SI units."""

    place: int
    """Index of the column in the table, from 0."""
    name: str
    """Name of the column without the unit."""
    scale: float
    """Factor that converts the values of the column to SI units; negative to invert the sign."""


def split_heading(cell: str) -> Heading:
    """Split the text in the header of a column into name and unit; the unit is None if unknown.

    Examples
    --------
    >>> split_heading("Force [gf]"), split_heading("Weg in mm"), split_heading("Position (z), um")
    (Heading(name='Force', unit='gf'), Heading(name='Weg', unit='mm'), \
Heading(name='Position (z)', unit='um'))
    """
    cell = cell.strip()
    start = max(cell.rfind("["), cell.rfind("("))
    if start > 0 and cell.endswith(("]", ")")):
        name, unit = cell[:start].strip(" _,"), cell[start + 1 : -1].strip()
        return Heading(cell) if unit in AXES else Heading(name, canonical(unit))
    for separator in (",", " in ", "/", "_", " "):
        name, found, unit = cell.rpartition(separator)
        if found and name.strip() and is_unit(unit):
            clear = separator in (",", " in ") or has_unit(last_name(name), unit)
            if clear and (separator, unit) != MASTER:
                return Heading(name.strip(), canonical(unit))
    return Heading(cell)


def has_unit(name: str, unit: str) -> bool:
    """Return whether `name` is a usual name of time, position or force, and `unit` a unit of it."""
    return any(name in KNOWN[kind] and size_of(unit, kind) for kind in KNOWN)


def last_name(name: str) -> str:
    """Return the last part of a name: `field` for `group/field` or `group.field`.

    The result is in lower case, with spaces instead of `_` (see `plain`).
    """
    return plain(re.split(r"[/.](?=\w)", name)[-1])


def units_of(kind: str) -> str:
    """Return the names of the units of one quantity as a text, for error messages."""
    more = f" (with --lever: {', '.join(ON_LEVER[kind])})" if ON_LEVER[kind] else ""
    return ", ".join(UNITS[kind]) + more


def listed(headings: Sequence[Heading]) -> str:
    """Return the names and units of the columns of a table as a text, for error messages."""
    shown = headings[:COLUMNS_SHOWN]
    more = ", ..." if len(headings) > len(shown) else ""
    names = ", ".join(repr(heading.name) for heading in shown) + more
    if not any(heading.unit for heading in shown):
        return f"{names} (without units)"
    return f"{names} (in {', '.join(heading.unit or '-' for heading in shown)}{more})"


def find_column(where: str, headings: Sequence[Heading], kind: str, wanted: Wanted) -> Column:
    """Find the column of a quantity: the column that the user states, or one with a usual name."""
    asked: str | None = getattr(wanted, kind)
    place, unit = place_of(where, headings, kind, asked)
    name, stated = headings[place]
    if unit and stated and canonical(unit) != canonical(stated):
        raise InputError(
            f"{where}: column {name!r} is in {stated!r} according to the header, not in {unit!r}"
        )
    unit = unit or stated
    if unit is None:
        raise InputError(
            f"{where}: column {name!r} has no unit: expected a header such as "
            f"'{name} [{next(iter(UNITS[kind]))}]', or --{kind} '{name}=UNIT' "
            f"with one of {units_of(kind)}"
        )
    size = size_of(unit, kind)
    if size is None:
        raise InputError(
            f"{where}: column {name!r} has unknown unit {unit!r}: expected {units_of(kind)}"
        )
    scale = size.scale
    if size.on_lever:
        if wanted.lever is None:
            raise InputError(
                f"{where}: column {name!r} is in {unit!r}: expected --lever with the length of "
                "the lever arm, such as --lever 50mm"
            )
        scale = scale * wanted.lever if kind == "position" else scale / wanted.lever
    inverted = kind != "time" and wanted.invert in (kind, "both")
    return Column(place, name, -scale if inverted else scale)


def place_of(
    where: str, headings: Sequence[Heading], kind: str, asked: str | None
) -> tuple[int, str | None]:
    """Find the index of the column of a quantity, and the unit that the user states for it."""
    if asked is None:
        names = [plain(heading.name) for heading in headings]
        ends = [last_name(heading.name) for heading in headings]
        for synonym in map(plain, NAMES[kind]):
            matches = [i for i, name in enumerate(names) if name == synonym]
            if not matches:  # the user must choose the axis of a vector x, y, z
                matches = [
                    i
                    for i, end in enumerate(ends)
                    if end == synonym and f"{names[i][:-1]}y" not in names
                ]
            if not matches and len(synonym) > 1:
                matches = [i for i, name in enumerate(names) if NUMBERED.sub("", name) == synonym]
            if matches:
                return only(where, headings, kind, matches), None
        rate = ", or --rate HZ for evenly sampled data" if kind == "time" else ""
        raise InputError(
            f"{where}: no {kind} column: expected one named {', '.join(NAMES[kind][:SHOWN])}, ..., "
            f"or --{kind} COLUMN{rate}; columns: {listed(headings)}"
        )
    unit = None
    name, equals, given = asked.rpartition("=")
    if equals and not any(asked == heading.name for heading in headings):
        asked, unit = name, given
    wanted = split_heading(asked)
    by_name = [i for i, h in enumerate(headings) if h.name.casefold() == asked.casefold()]
    matches = by_name or [
        i for i, h in enumerate(headings) if h.name.casefold() == wanted.name.casefold()
    ]
    parts = (f".{asked}".casefold(), f"/{asked}".casefold())
    matches = matches or [i for i, h in enumerate(headings) if h.name.casefold().endswith(parts)]
    unit = unit or (None if by_name else wanted.unit)
    if not matches and asked.isdecimal() and 1 <= int(asked[:9]) <= len(headings):
        return int(asked) - 1, unit
    if not matches:
        raise InputError(f"{where}: no column {asked!r}: expected one of {listed(headings)}")
    return only(where, headings, kind, matches), unit


def only(where: str, headings: Sequence[Heading], kind: str, matches: Sequence[int]) -> int:
    """Return the index of the matching column, and check that only one column matches.

    The list `matches` contains the indices of the matching columns, at least one.
    """
    if len(matches) > 1:
        numbers = ", ".join(str(i + 1) for i in matches[:SHOWN])
        raise InputError(
            f"{where}: {len(matches)} columns are named {plain(headings[matches[0]].name)!r}, "
            f"expected one, or --{kind} with the number of the column: {numbers}"
        )
    return matches[0]


def find_columns(where: str, headings: Sequence[Heading], wanted: Wanted) -> dict[str, Column]:
    """Find the columns of position, force and time, and return them by the name of the quantity.

    If the user states a sampling rate, no column of time is necessary, and none is searched.
    """
    kinds = ("position", "force") if wanted.rate else ("time", "position", "force")
    columns = {kind: find_column(where, headings, kind, wanted) for kind in kinds}
    if len({column.place for column in columns.values()}) < len(columns):
        names = f"{', '.join(kinds[:-1])} and {kinds[-1]}"
        count = "three" if len(kinds) == 3 else "two"
        raise InputError(f"{where}: {names} must be {count} different columns")
    return columns


@dataclass(frozen=True)
class Picker:
    """Function that takes the headings of a table and returns the indices of the columns to load.

    They are the columns of position, force and time; none if one of them is not found.
    """

    wanted: Wanted
    """The options of the user."""
    whole: Collection[str] = ()
    """Names of columns. If a table contains all of them, every column is loaded. If it is empty,
    this rule does not apply."""

    def __call__(self, headings: Sequence[Heading]) -> Collection[int]:
        """Return the indices of the columns to load."""
        if self.whole and set(self.whole) <= {heading.name for heading in headings}:
            return range(len(headings))
        try:
            return {column.place for column in find_columns("", headings, self.wanted).values()}
        except InputError:
            return ()
