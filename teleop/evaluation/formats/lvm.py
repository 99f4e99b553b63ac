"""Read LabVIEW measurement files (.lvm), which are text files."""

from __future__ import annotations

import io
from itertools import zip_longest
from pathlib import Path

import numpy as np

from drivers.input_file import open_input
from teleop.errors import InputError
from teleop.evaluation.formats.arrays import heading
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.delimited import HEAD, not_text, parts
from teleop.evaluation.formats.dialect import Dialect
from teleop.evaluation.formats.encoding import encoding_of
from teleop.evaluation.formats.numbers import NumberReader
from teleop.evaluation.formats.table import Heading, Pick, Places, Table, stated_filter

END = "***End_of_Header***"
SEPARATORS = {"Tab": "\t", "Comma": ","}


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read the tables of a LabVIEW measurement file.

    The file consists of segments. A segment has a header and a table of samples. If the table has
    no time column, the times are computed from the start `X0` and the step `Delta_X` in the header.
    """
    with open_input(path) as file:
        head = file.read(HEAD)
        file.seek(0)
        encoding = encoding_of(head)
        if encoding is None:
            raise not_text(path)
        with io.TextIOWrapper(file, encoding, "replace") as text:
            segments = Segments(path, pick)
            for first, lines in parts(path, text):
                segments.feed(first, lines)
    return segments.tables()


def is_header(line: str) -> bool:
    """Return whether a line begins a header: that of the file, or that of one of its tables."""
    return line.startswith(("Channels\t", "Channels,", "LabVIEW Measurement"))


class Segments:
    """Parser of a LabVIEW measurement file. Each segment (header and samples) becomes a table."""

    def __init__(self, path: Path, pick: Pick) -> None:
        self._path, self._pick = path, pick
        self._delimiter, self._decimal = "\t", "."
        self._header: dict[str, list[str]] = {}
        self._stated: list[str] = []
        self._x_columns = "One"
        self._in_header = True
        self._rows: NumberReader | None = None
        self._found: list[tuple[Table, NumberReader, list[float] | None]] = []

    def feed(self, first: int, lines: list[str]) -> None:
        """Parse the next lines of the file. The first of them has the line number `first`."""
        i = 0
        while i < len(lines):
            if self._rows:
                end = next((k for k in range(i, len(lines)) if is_header(lines[k])), len(lines))
                width, d = len(self._rows.headings), self._delimiter
                without_comments = [
                    line if line.count(d) < width else d.join(line.split(d, width)[:width])
                    for line in lines[i:end]
                ]
                self._rows.feed(first + i, without_comments)
                i = end
                if i < len(lines):
                    self._rows, self._in_header, self._header = None, True, {}
                continue
            self._take(first + i, lines[i])
            i += 1

    def _take(self, number: int, line: str) -> None:
        """Process a line above the samples of a table.

        Such a line belongs to the header, or it contains the names of the columns.
        """
        if line.startswith(END):
            self._in_header = False
        elif is_header(line):
            self._in_header, self._header = True, {}
        elif not self._in_header and line.strip():
            self._start(number, line)
        if self._in_header:
            key, _, value = line.partition("," if "," in line[:40] and "\t" not in line else "\t")
            if key == "Separator":
                self._delimiter = SEPARATORS.get(value.strip(), "\t")
            elif key == "Decimal_Separator":
                self._decimal = value.strip() or "."
            elif key == "X_Columns":
                self._x_columns = value.strip()
            self._header[key] = [cell.strip() for cell in value.split(self._delimiter)]
            self._stated.append(line)

    def _start(self, number: int, line: str) -> None:
        """Begin the table of a segment, after the header of the segment."""
        names = [name.strip() for name in line.split(self._delimiter)]
        while len(names) > 1 and names[-1] in ("", "Comment"):
            names.pop()
        units = self._header.get("Y_Unit_Label", [])
        headings = [
            heading(name, unit) for name, unit in zip_longest(names[1:], units, fillvalue="")
        ][: len(names) - 1]
        time = self._header.get("X_Dimension", ["Time"])[0] == "Time"
        headings.insert(0, Heading(names[0], "s" if time else None))
        picked = set(self._pick(headings))
        waveform = None
        if self._x_columns == "No" and 0 in picked:
            picked -= {0}
            waveform = [self._number(key, number) for key in ("X0", "Delta_X")]
        place = f"{self._path}, line "
        dialect = Dialect(self._delimiter, self._decimal)
        self._rows = NumberReader(lambda n: f"{place}{n}", headings, picked, dialect)
        title = f"segment {len(self._found) + 1}"
        table = Table(f"{place}{number}", headings, {}, 0, str, title)
        if stated := stated_filter(self._stated):
            table.about["force_filter"] = stated
        self._found.append((table, self._rows, waveform))

    def _number(self, key: str, line: int) -> float:
        """Return the number that the header states for a key. The header ends before this line."""
        text = self._header.get(key, [""])[0]
        try:
            return float(text.replace(",", "."))
        except ValueError:
            raise InputError(
                f"{self._path}, line {line}: {key} is {text!r} in the header above: expected a "
                "number, because the file has no column of times"
            ) from None

    def tables(self) -> list[Table]:
        """Return the tables of all segments. Call this method after the last line was parsed."""
        for table, rows, waveform in self._found:
            numbers = rows.numbers()
            table.columns, table.problem = rows.columns(), rows.problem
            table.samples = len(numbers)
            table.sample = Places(f"{self._path}, line ", numbers)
            if waveform:
                table.columns[0] = (
                    waveform[0] + np.arange(len(numbers), dtype=np.float64) * waveform[1]
                )
        return [table for table, _, _ in self._found]
