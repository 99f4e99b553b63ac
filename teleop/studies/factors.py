"""Read the levels of the factors of measurement files from the names of the files, or from a table.

A factor is a property in which files differ, for example `specimen`. Its level is the value for one
file, for example `liver`.
"""

from __future__ import annotations

import csv
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from drivers.input_file import read_input
from teleop.errors import InputError
from teleop.files import unreadable

ALWAYS_KNOWN = ("file", "folder")
"""Factors that every file has: its name, and the name of its folder."""
PLACEHOLDER = re.compile(r"\{([^{}]*)\}|(\*)")
"""Pattern of a factor in braces, or of an asterisk, in a pattern of file names."""
DELIMITERS = ",;\t"
"""Characters that can separate the cells of a table of factors."""


class Factors(ABC):
    """The levels of the factors of files."""

    def __init__(self, name: str, files: tuple[Path, ...]) -> None:
        self.name = name
        """The pattern, or the name of the file with the table, for messages."""
        self.files = files
        """The file with the table, which is no measurement."""

    @abstractmethod
    def levels(self, path: Path, place: PurePosixPath | None) -> dict[str, str] | None:
        """Return the levels of a file by the name of the factor; None if they are not known.

        `place` is the path of the file relative to the folder that is searched. It is None for a
        file that was named itself.
        """

    def check_used(self, paths: Iterable[Path]) -> list[tuple[str, str]]:
        """Return each name that belongs to none of the files, and the problem."""
        return []


def read_factors(text: str) -> Factors:
    """Return the factors that a pattern of file names (with braces) or a table file states."""
    return NamePattern(text) if "{" in text or "}" in text else FactorTable(Path(text))


class NamePattern(Factors):
    """A pattern of file names, such as `{subject}/{specimen}_rep{n}.csv`.

    A name in braces is a factor. It stands for one or more characters of a file name, and an
    asterisk for any number of characters. None of these characters is a slash. A factor that occurs
    twice has the same level at both places.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name, ())
        factors = [factor for factor, star in PLACEHOLDER.findall(name) if not star]
        rest = PLACEHOLDER.sub("", name)
        if "{" in rest or "}" in rest or not all(factor.isidentifier() for factor in factors):
            raise InputError(
                f"--factors {name!r}: expected names of factors in braces, such as "
                "{subject}/{specimen}_rep{n}.csv"
            )
        check_names(f"--factors {name!r}", factors)
        self._parts = len(PurePosixPath(name).parts)
        self._greedy = re.compile(self._expression(""))
        self._lazy = re.compile(self._expression("?"))

    def _expression(self, lazy: str) -> str:
        """Return the regular expression; `lazy` is `?` for the shortest level of each factor."""
        text, end, known = "", 0, set()
        for found in PLACEHOLDER.finditer(self.name):
            text += re.escape(self.name[end : found.start()])
            end, factor = found.end(), found[1]
            if factor is None:
                text += f"[^/]*{lazy}"
            elif factor in known:
                text += f"(?P={factor})"
            else:
                text += f"(?P<{factor}>[^/]+{lazy})"
                known.add(factor)
        return text + re.escape(self.name[end:])

    def levels(self, path: Path, place: PurePosixPath | None) -> dict[str, str] | None:
        """Return the levels in the name of a file; None if the name does not match."""
        if place is None:
            place = PurePosixPath(*path.absolute().parts[-self._parts :])
        longest, shortest = (
            expression.fullmatch(str(place)) for expression in (self._greedy, self._lazy)
        )
        if not (longest and shortest):
            return None
        if longest.groupdict() != shortest.groupdict():
            two = " or ".join(
                ", ".join(f"{factor} = {level}" for factor, level in found.groupdict().items())
                for found in (longest, shortest)
            )
            raise InputError(
                f"{path}: matches {self.name!r} in several ways ({two}): expected a pattern with "
                "one meaning, or a table of the factors"
            )
        return longest.groupdict()


@dataclass(frozen=True)
class Row:
    """A row of a table of factors."""

    line: int
    """Number of its line in the file."""
    levels: dict[str, str]
    """Levels of the file that the row names, by the name of the factor."""


class FactorTable(Factors):
    """A CSV table: the first column names files, and each other column is a factor.

    A file can be named by its name or by the end of its path, such as `s01/liver_rep1.csv`. An
    empty cell states that the level is not known.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(str(path), (path,))
        self.path = path
        self._rows: dict[tuple[str, ...], Row] = {}
        try:
            text = read_input(path).decode("utf-8-sig")
        except FileNotFoundError as error:
            raise InputError(
                f"--factors {path}: no such file: expected a table, or a pattern with factors in "
                "braces, such as {subject}/{specimen}_rep{n}.csv"
            ) from error
        except OSError as error:
            raise unreadable(path, error) from error
        except UnicodeDecodeError as error:
            raise InputError(f"{path}: expected a table of text in UTF-8 (CSV)") from error
        try:
            self._read(text)
        except csv.Error as error:
            raise InputError(f"{path}: cannot be read as a table: {error}") from error

    def _read(self, text: str) -> None:
        first = text.partition("\n")[0]
        delimiter = max(DELIMITERS, key=first.count)
        reader = csv.reader(text.splitlines(), delimiter=delimiter)
        header = [cell.strip() for cell in next(reader, ())]
        names = header[1:]
        if not names or not all(names):
            raise InputError(
                f"{self.path}, line 1: expected a header: a column with the names of the files, "
                "and a column for each factor"
            )
        check_names(f"{self.path}, line 1", names)
        if len(set(names)) < len(names):
            raise InputError(f"{self.path}, line 1: expected different names of the factors")
        for cells in reader:
            if not any(cells):
                continue
            where = f"{self.path}, line {reader.line_num}"
            if len(cells) != len(header):
                raise InputError(f"{where}: expected {len(header)} cells, got {len(cells)}")
            file, *levels = (cell.strip() for cell in cells)
            key = PurePosixPath(file.replace("\\", "/")).parts
            if not key:
                raise InputError(f"{where}: expected the name of a file in the first column")
            if key in self._rows:
                raise InputError(f"{where}: {file} is also named in line {self._rows[key].line}")
            known = {name: level for name, level in zip(names, levels, strict=True) if level}
            self._rows[key] = Row(reader.line_num, known)

    def _keys(self, path: Path) -> list[tuple[str, ...]]:
        """Return the names in the table that are those of a file."""
        parts = path.absolute().parts
        ends = (parts[start:] for start in range(len(parts)))
        return [end for end in ends if end in self._rows]

    def levels(self, path: Path, place: PurePosixPath | None) -> dict[str, str] | None:
        """Return the levels of a file; None if the table does not name the file."""
        keys = self._keys(path)
        if len(keys) > 1:
            lines = " and ".join(str(self._rows[key].line) for key in keys)
            raise InputError(f"{self.path}: lines {lines} name the same file {path}")
        return self._rows[keys[0]].levels if keys else None

    def check_used(self, paths: Iterable[Path]) -> list[tuple[str, str]]:
        """Return the names of the table that name none of the files.

        Raises InputError if a name of the table is that of several files.
        """
        named: dict[tuple[str, ...], Path] = {}
        for path in paths:
            for key in self._keys(path):
                if key in named:
                    raise InputError(
                        f"{self.path}, line {self._rows[key].line}: names {named[key]} and {path}: "
                        "expected the name with its folder"
                    )
                named[key] = path
        return [
            (str(PurePosixPath(*key)), f"{self.path}, line {row.line}: no such file is compared")
            for key, row in self._rows.items()
            if key not in named
        ]


def check_names(where: str, names: Iterable[str]) -> None:
    """Raise InputError if a factor has the name of a factor that every file has."""
    for name in names:
        if name in ALWAYS_KNOWN:
            raise InputError(f"{where}: every file has the factor {name}: expected another name")
