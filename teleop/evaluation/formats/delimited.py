"""Read text tables: CSV, TSV and the text exports of testing machines."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from drivers.input_file import open_input, read_input
from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.dialect import Dialect, dialect_of, is_clock
from teleop.evaluation.formats.encoding import encoding_of
from teleop.evaluation.formats.layout import (
    fitted,
    headings_above,
    is_number,
    is_samples,
)
from teleop.evaluation.formats.numbers import NumberReader
from teleop.evaluation.formats.table import Heading, Pick, Places, Table, stated_filter
from teleop.files import unreadable
from teleop.json_documents import dumps, loads

LONGEST_LINE = 1 << 18
"""Largest number of characters in a line of a table."""
HEAD = 1 << 16
"""Number of bytes at the beginning of a file from which its encoding is determined."""
PART = 1 << 20
"""Number of characters that are read in one call."""
PREAMBLE = 1000
"""Largest number of lines above a header that are searched for a description of a force filter."""
METADATA = "-metadata.json"
"""End of the name of the metadata file that `teleop export` writes next to a CSV file."""
FEWEST = 3
"""Smallest number of samples in a table without the wanted columns. Smaller ones are ignored."""

Part = tuple[int, list[str]]
"""Part of a text file: the number of its first line, and its lines."""


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read the tables of a text file.

    A file may contain several tables, and other text (a preamble) above each header. Lines that
    begin with # are comments. Above the samples, lines that begin with % are comments too. The last
    comment above the samples can be the header.

    A table ends at the first line that contains text but no number. After an empty line, it also
    ends at a line that does not fit the table, such as a line with text instead of a number.
    """
    names = [name for name in wanted[:3] if name]
    with open_input(path) as file:
        head = file.read(HEAD)
        file.seek(0)
        encoding = encoding_of(head, names)
        if encoding is None:
            raise not_text(path)
        strict = encoding.startswith("utf-16")
        errors = "strict" if strict else "replace"
        try:
            with io.TextIOWrapper(file, encoding, errors) as text:
                tables = tables_in(path, parts(path, text), pick)
        except UnicodeError as error:
            raise not_text(path) from error
    for table in tables:
        table.about |= exported_metadata(path)
    return tables


def exported_metadata(path: Path) -> dict[str, str]:
    """Read the metadata file that `teleop export` writes next to a CSV file."""
    beside = path.with_name(f"{path.name}{METADATA}")
    try:
        notes = loads(read_input(beside)).get("notes")
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise unreadable(beside, error) from error
    except ValueError as error:
        raise InputError(f"{beside}: cannot be read: {error}") from error
    notes = notes[0] if isinstance(notes, list) and notes else {}
    names = ("settings", "session", "events")
    return {name: dumps(notes[name]) for name in names if isinstance(notes, dict) and name in notes}


def not_text(path: Path) -> InputError:
    """Return the error to raise for a file that is not text."""
    return InputError(f"{path}: not a text file: expected a table in UTF-8, UTF-16 or a code page")


def parts(path: Path, text: io.TextIOWrapper) -> Iterator[Part]:
    """Yield the lines of the open file `text` in parts of successive lines (see `Part`)."""
    number, rest = 1, ""
    while block := text.read(PART):
        if "\0" in block:
            raise not_text(path)
        lines = (rest + block).split("\n")
        rest = lines.pop()
        for i, line in enumerate([*lines, rest]):
            if len(line) > LONGEST_LINE:
                raise InputError(
                    f"{path}, line {number + i}: expected a line of at most {LONGEST_LINE} "
                    "characters"
                )
        if lines:
            yield number, lines
        number += len(lines)
    if rest:
        yield number, [rest]


def tables_in(path: Path, lines: Iterable[Part], pick: Pick) -> list[Table]:
    """Return the tables in a text file (see `read`); `lines` are the lines of the file in parts."""
    scan: Scan | None = None
    for first, part in lines:
        scan = scan or Scan(path, pick, dialect_of(part))
        scan.feed(first, part)
    if scan is None:
        raise InputError(f"{path}: the file is empty: expected a header line and samples")
    return scan.end()


def title_of(lines: Sequence[str]) -> str:
    """Return the title of a table: the last tag above it, such as <Specimen 1>, or the last line.

    Tags that begin with `Data`, `Info`, `End` or `/` are ignored.
    """
    lines = [line.strip(' \t,;"') for line in lines]
    tags = [line for line in lines if re.fullmatch(r"<(?!/|end|data|info)[^<>]+>", line, re.I)]
    return (tags or lines or [""])[-1]


class Scan:
    """Parser that finds the tables in the lines of a file."""

    def __init__(self, path: Path, pick: Pick, dialect: Dialect) -> None:
        self._path, self._pick, self._dialect = path, pick, dialect
        self._above: list[tuple[int, str]] = []
        self._before: list[tuple[int, str]] = []
        self._stated: list[str] = []
        self._comment: tuple[int, str] | None = None
        self._tables: list[tuple[Table, NumberReader]] = []
        self._rows: NumberReader | None = None

    def feed(self, first: int, lines: list[str]) -> None:
        """Parse the next lines of the file. The first of them has the line number `first`."""
        i = 0
        while i < len(lines):
            if self._rows:
                i += self._rows.feed(first + i, lines[i:] if i else lines)
                if i < len(lines):
                    self._close()
                continue
            line = lines[i]
            if line.startswith(("#", "%")):
                self._comment = (first + i, line.strip("#% "))
                self._state(line)
            elif line.strip():
                cells = self._cells(first + i, line)
                if is_samples(cells) and (found := self._start(first + i, cells)):
                    self._rows = found
                    continue
                self._above.append((first + i, line))
                self._state(line)
            i += 1

    def end(self) -> list[Table]:
        """Return all tables of the file. Call this method after the last line was parsed."""
        self._close()
        if not self._tables and not self._above:
            raise InputError(f"{self._path}: the file is empty: expected a header line and samples")
        if not any(rows.picked for _, rows in self._tables) and self._above:
            self._only_a_header()
        for table, rows in self._tables:
            numbers = rows.numbers()
            table.columns = rows.columns()
            table.samples = len(numbers)
            table.problem = rows.problem
            table.sample = Places(self._place(""), numbers)
        return [table for table, _ in self._tables]

    def _close(self) -> None:
        """End the table, and discard it if it has no wanted column and fewer than `FEWEST` rows."""
        if self._rows and not self._rows.picked and self._rows.samples < FEWEST:
            self._tables.pop()
            self._above = self._before
        self._rows = None

    def _only_a_header(self) -> None:
        """Add a table without samples for the first line that names the wanted columns.

        This is done for a file without samples of these columns. If the file has no table at all,
        its first line is added as a header too, so that an error message can list its cells.
        """
        for number, line in self._above:
            names = fitted(self._cells(number, line), 0)
            found = headings_above([names], len(names))
            headings = found[0] if found else [Heading(name) for name in names]
            if not self._tables or self._pick(headings):
                self._add(number, headings, "")
                if self._tables[-1][1].picked:
                    return

    def _place(self, number: int | str) -> str:
        return f"{self._path}, line {number}"

    def _cells(self, number: int, line: str) -> list[str]:
        try:
            return self._dialect.split(line)
        except csv.Error as error:
            raise InputError(
                f"{self._place(number)}: cannot be read as a table: {error}"
            ) from error

    def _state(self, line: str) -> None:
        if len(self._stated) < PREAMBLE:
            self._stated.append(line)

    def _start(self, number: int, cells: list[str]) -> NumberReader | None:
        """Begin a table at its first row of samples; return None if the row cannot begin a table.

        If there is no header above the row, the table has the headings of the previous table if
        both have the same number of columns. Otherwise, its columns are named 1, 2, ...
        """
        above = self._above[-2:]
        width = len(cells)
        rows = [self._header_cells(n, line, width) for n, line in above]
        found = headings_above(rows, width)
        if found is None and self._comment:  # as numpy.savetxt writes it
            above = [self._comment]
            found = headings_above([self._header_cells(*self._comment, width)], width)
        if found:
            headings, row = found
            for i, cell in enumerate(cells[: len(headings)]):
                if is_clock(cell) and headings[i].unit is None:
                    headings[i] = headings[i]._replace(unit="s")
            before = self._above[: max(len(self._above) - len(above) + row, 0)]
            return self._add(above[row][0], headings, title_of([line for _, line in before]))
        if self._tables and len(self._tables[-1][0].headings) == len(fitted(cells, 0)):
            headings = list(self._tables[-1][0].headings)
            if all(is_number(cells[i]) or is_clock(cells[i]) for i in self._pick(headings)):
                title = self._above[-1][1].strip() if self._above else ""
                return self._add(number, headings, title)
            return None
        names = [Heading(str(i + 1)) for i in range(width)]
        return self._add(number, names, "") if not self._above or self._pick(names) else None

    def _header_cells(self, number: int, line: str, width: int) -> list[str]:
        """Split a header into cells. A name and the unit in brackets after it are one cell."""
        cells = self._cells(number, line)
        if self._dialect.delimiter is None and len(cells) != width:
            return re.findall(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?", line)
        return cells

    def _add(self, number: int, headings: list[Heading], title: str) -> NumberReader:
        rows = NumberReader(self._place, headings, self._pick(headings), self._dialect)
        where = self._place(number)
        table = Table(where, headings, {}, 0, str, title[:60])
        if found := stated_filter(self._stated):
            table.about["force_filter"] = found
        self._tables.append((table, rows))
        self._before, self._above, self._comment = self._above, [], None
        return rows
