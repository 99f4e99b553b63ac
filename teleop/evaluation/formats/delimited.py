"""Tables of measurements: CSV or TSV files whose header names quantities and units."""

from __future__ import annotations

import codecs
import contextlib
import csv
import io
import math
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, NamedTuple, TextIO

import numpy as np

from drivers.input_file import open_input
from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.files import unreadable
from teleop.recording.gaps import long_periods

UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0},
    "position": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "force": {
        "N": 1.0,
        "mN": 1e-3,
        "kN": 1e3,
        "gf": 9.80665e-3,
        "kgf": 9.80665,
        "lbf": 4.4482216152605,
    },
}
"""Units of each quantity and their size in SI units."""

NAMES = {
    "time": ("time", "t", "timestamp"),
    "position": ("displacement", "slave_position", "indentation", "depth", "position", "x"),
    "force": ("force", "contact_force", "contact force", "interaction force", "load", "f"),
}
"""Names by which a quantity's column is found, in any case."""

MICRO, GREEK_MU = "\u00b5", "\u03bc"
"""The sign of micro and the letter that looks like it: Unicode has both, and prefers the letter."""

LARGEST = 1e12
"""Largest time, position and force in SI units that is taken for a measurement."""
LONGEST_LINE = 1 << 18
"""Most characters in a line of a table."""
SHORTEST = 1e-9
"""Shortest sample period [s]."""


class Signals(NamedTuple):
    """Measured time [s], position [m] and force [N], arrays of shape (n,)."""

    t: Floats
    x: Floats
    f: Floats
    dt: Floats
    """Time since the sample before [s]."""
    position_name: str
    """Name of the position's column, without its unit."""
    gaps: tuple[int, ...] = ()
    """Numbers of the samples before which samples are missing."""


def periods(t: Floats) -> Floats:
    """Time since the sample before [s]; for the first sample the median of the others."""
    steps = np.diff(t)
    return np.concatenate(([np.median(steps)], steps))


class Column(NamedTuple):
    """A column of a file: where it is, and how large its unit is in SI units."""

    place: int
    name: str
    scale: float


def split_header(cell: str) -> tuple[str, str | None]:
    """Name and unit of a header cell such as `Force [gf]` or `Force (gf)`."""
    cell = cell.strip().replace(GREEK_MU, MICRO)
    start = max(cell.rfind("["), cell.rfind("("))
    if start < 0 or not cell.endswith(("]", ")")):
        return cell, None
    return cell[:start].strip(), cell[start + 1 : -1].strip()


def find_column(where: str, header: list[str], quantity: str, wanted: str | None) -> Column:
    """The column of a quantity, by name, or the one that is `wanted`: NAME or NAME=UNIT."""
    cells = [split_header(cell) for cell in header]
    unit = None
    if wanted is None:
        names = [name for name in NAMES[quantity] for cell, _ in cells if cell.lower() == name]
        expected = f"one named {', '.join(NAMES[quantity])}, or --{quantity} COLUMN"
    else:
        name, equals, given = wanted.rpartition("=")
        if wanted not in header and equals:
            wanted, unit = name, given.replace(GREEK_MU, MICRO)
        name, named_unit = split_header(wanted)
        unit = unit or named_unit
        names = [name]
        expected = f"one of {', '.join(repr(name) for name, _ in cells)}"
    matches = [i for i, (name, _) in enumerate(cells) if names and name.lower() == names[0].lower()]
    if not matches:
        asked = f"column {wanted!r}" if wanted else f"{quantity} column"
        raise InputError(f"{where}: no {asked}: expected {expected}")
    if len(matches) > 1:
        raise InputError(f"{where}: {len(matches)} columns are named {names[0]!r}, expected one")
    index = matches[0]
    name = cells[index][0]
    if unit and cells[index][1] not in (None, unit):
        raise InputError(
            f"{where}: column {name!r} is in {cells[index][1]!r} by the header, not in {unit!r}"
        )
    unit = unit or cells[index][1]
    units = ", ".join(UNITS[quantity])
    if unit is None:
        raise InputError(
            f"{where}: column {name!r} has no unit: expected a header such as "
            f"'{name} [{next(iter(UNITS[quantity]))}]', or --{quantity} '{name}=UNIT' "
            f"with one of {units}"
        )
    if unit not in UNITS[quantity]:
        raise InputError(f"{where}: column {name!r} has unknown unit {unit!r}: expected {units}")
    return Column(index, name, UNITS[quantity][unit])


def read_signals(
    path: Path,
    position: str | None = None,
    force: str | None = None,
    time: str | None = None,
) -> Signals:
    """Read time, position and force from a CSV or TSV file, in SI units.

    Parameters
    ----------
    path
        The file: a header line with units, such as `Time [s],Position [mm],Force [gf]`, and
        a line a sample; lines that begin with # are comments. The separator, of comma, tab
        and semicolon, is told from the header; with the latter two, numbers may have a
        decimal comma.
    position, force, time
        Column to take, as NAME or, where the header has no unit, NAME=UNIT; by default the
        one that has a usual name.

    Raises
    ------
    InputError
        The file, a column, a unit or a value is not as expected; names file and line.
    """
    try:
        with io.TextIOWrapper(open_input(path), "latin-1") as file:
            return signals_in(path, lines_in(path, file), position, force, time)
    except OSError as error:
        raise unreadable(path, error) from error


def lines_in(path: Path, file: TextIO) -> Iterator[tuple[int, str]]:
    """The lines of a text file that are neither blank nor comments, with their numbers.

    Raises
    ------
    InputError
        It is not a text file, or a line is too long.
    """
    number = 0
    while line := file.readline(LONGEST_LINE + 1):
        number += 1
        if "\0" in line:
            raise InputError(f"{path}: not a text file: expected CSV or TSV in UTF-8 or Latin-1")
        if len(line) > LONGEST_LINE:
            raise InputError(
                f"{path}, line {number}: expected a line of at most {LONGEST_LINE} characters"
            )
        with contextlib.suppress(UnicodeDecodeError):
            line = line.encode("latin-1").decode()
        if number == 1:
            line = line.removeprefix("\ufeff")
        if line.strip() and not line.startswith("#"):
            yield number, line.rstrip("\n")


def signals_in(
    path: Path,
    lines: Iterator[tuple[int, str]],
    position: str | None,
    force: str | None,
    time: str | None,
) -> Signals:
    """The signals in the lines of a table; see `read_signals`."""
    first, line = next(lines, (0, ""))
    if not line:
        raise InputError(f"{path}: the file is empty: expected a header line and samples")
    delimiter = max("\t;,", key=line.count)
    where = f"{path}, line {first}"
    header = split_line(where, line, delimiter)
    columns = [
        find_column(where, header, quantity, wanted)
        for quantity, wanted in (("time", time), ("position", position), ("force", force))
    ]

    samples, numbers = array("d"), array("q")
    for number, line in lines:
        if delimiter != ",":
            line = line.replace(",", ".")
        cells = split_line(f"{path}, line {number}", line, delimiter)
        if len(cells) != len(header):
            raise InputError(
                f"{path}, line {number}: {len(cells)} cells, expected {len(header)} by the header"
            )
        samples.extend(read_value(f"{path}, line {number}", cells, c, header) for c in columns)
        numbers.append(number)
    if len(numbers) < 3:
        raise InputError(f"{path}: {len(numbers)} samples: expected at least 3")
    t, x, f = (np.array(samples).reshape(-1, 3) * [column.scale for column in columns]).T
    if len({column.place for column in columns}) < len(columns):
        raise InputError(f"{where}: time, position and force must be three columns")
    for name, channel in (("time", t), ("position", x), ("force", f)):
        if not np.abs(channel).max() < LARGEST:
            i = int(np.argmax(np.abs(channel)))
            raise InputError(
                f"{path}, line {numbers[i]}: a {name} of {channel[i]:g} in SI units, "
                f"expected less than {LARGEST:g}"
            )
    steps = np.diff(t)
    if (steps > 0.0).all() and steps.min() < SHORTEST:
        raise InputError(f"{path}: times {steps.min():g} s apart: expected {SHORTEST:g} s or more")
    if not (steps > 0.0).all():
        i = int(np.argmin(steps > 0.0))
        what = "repeats" if steps[i] == 0.0 else "runs backwards"
        raise InputError(
            f"{path}, line {numbers[i + 1]}: time {what}, from {t[i]:g} s to {t[i + 1]:g} s: "
            "expected times that rise"
        )
    dt = periods(t)
    return Signals(t, x, f, dt, columns[1].name, tuple(long_periods(dt).tolist()))


NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.]+)")


def quantity(text: str, kind: str) -> float | None:
    """A number with a unit of this kind, such as 1.5mm, in SI units; None if it is none."""
    match = NUMBER.fullmatch(text.strip().replace(GREEK_MU, MICRO))
    if not match or match[2] not in UNITS[kind]:
        return None
    value = float(match[1]) * UNITS[kind][match[2]]
    return value if abs(value) < LARGEST else None


def split_line(where: str, line: str, delimiter: str) -> list[str]:
    """The cells of a line."""
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except csv.Error as error:
        raise InputError(f"{where}: cannot be read as a table: {error}") from error


def read_value(where: str, cells: list[str], column: Column, header: list[str]) -> float:
    """The number in a column of a line."""
    cell = cells[column.place]
    try:
        value = float("text" if "_" in cell else cell)
    except ValueError:
        value = math.nan
        if cell.lower() not in ("nan", ""):
            raise InputError(
                f"{where}: {header[column.place]!r} is {cell!r}, expected a number"
            ) from None
    if not math.isfinite(value):
        raise InputError(
            f"{where}: {header[column.place]!r} is {cell or 'empty'}, expected a finite number"
        )
    return value


def write_table(file: BinaryIO, columns: Mapping[str, Floats], units: Mapping[str, str]) -> None:
    """Write columns as CSV, each number with all of its digits."""
    header = [f"{name} [{units[name]}]" for name in columns]
    rows: Iterable[tuple[float, ...]] = zip(*(c.tolist() for c in columns.values()), strict=True)
    writer = csv.writer(codecs.getwriter("utf-8")(file, "backslashreplace"))
    writer.writerow(header)
    writer.writerows(rows)
