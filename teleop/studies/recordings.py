"""Find the recordings that are to be compared, and the levels of the factors of each recording.

A level of a factor is its value for a recording, for example `mimic`. The folder of a series
contains the journal (a file with a line for each event), the table of the results (a CSV file), and
the folder of the recordings.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path, PurePosixPath
from typing import Any

from teleop.errors import InputError
from teleop.evaluation.across.comparison import BODY, REPETITIONS, SUBJECT, Compared
from teleop.evaluation.formats.search import is_measurement
from teleop.files import FAULT_REPORT, unreadable
from teleop.json_documents import loads
from teleop.recording.recording import stated_settings
from teleop.studies.factors import Factors
from teleop.studies.series.journal import NAME as JOURNAL
from teleop.studies.series.journal import RECORDINGS, Journal
from teleop.studies.series.plan import Plan
from teleop.studies.series.table import NAME
from teleop.studies.series.trials import cells

NO_LEVELS = "not stated by --factors"
"""Problem of a file whose levels neither the pattern nor the table states."""
NO_MEASUREMENT = "no measurement file"
"""Problem of a file in a folder that is not taken for a measurement."""


@dataclass(frozen=True)
class ComparedFile:
    """A file that is to be compared with other files, and the levels of its factors."""

    path: Path
    """The file."""
    levels: dict[str, str] = field(default_factory=dict)
    """Level of each factor that its series, the pattern of file names or the table of factors
    states, by the name of the factor."""


@dataclass(frozen=True)
class Sources:
    """The files that are to be compared, and the files that are not."""

    files: list[ComparedFile]
    """The files to compare."""
    left_out: list[tuple[str, str]]
    """Name of each file that is not compared, and the problem."""

    @property
    def measurements(self) -> list[Path]:
        """All measurement files, also those that are not compared."""
        unstated = [Path(file) for file, problem in self.left_out if problem == NO_LEVELS]
        return [*(file.path for file in self.files), *unstated]


def sources(paths: Iterable[Path], factors: Factors | None = None) -> Sources:
    """Return the files that are to be compared.

    Folders are searched for measurement files. `factors` states the levels of the files; a file
    whose levels it does not state is not compared.
    """
    not_searched = {os.path.realpath(path) for path in (factors.files if factors else ())}
    found: dict[str, ComparedFile] = {}
    left_out: list[tuple[str, str]] = []
    for path in paths:
        is_folder = path.is_dir() and not is_measurement(path)
        for source in of_folder(path, not_searched, left_out) if is_folder else [of_file(path)]:
            name = os.path.realpath(source.path)
            if name in found:
                raise InputError(f"{source.path} is named twice: expected different recordings")
            if factors:
                place = None
                if is_folder:
                    place = PurePosixPath(source.path.relative_to(path).as_posix())
                levels = factors.levels(source.path, place)
                if levels is None:
                    left_out.append((str(source.path), NO_LEVELS))
                    continue
                source = ComparedFile(source.path, source.levels | levels)
            found[name] = source
    if factors:
        if not found:
            unstated = [file for file, problem in left_out if problem != NO_MEASUREMENT]
            raise InputError(
                f"--factors {factors.name}: states the factors of none of the {len(unstated)} "
                f"measurement files, such as {unstated[0]}"
            )
        left_out += factors.check_used(source.path for source in found.values())
    return Sources([*found.values()], left_out)


def of_folder(
    folder: Path, ignored: Container[str], left_out: list[tuple[str, str]]
) -> list[ComparedFile]:
    """Return the measurement files in a folder and its subfolders.

    Of a series, these are only the recordings of trials that are done. Hidden files and folders are
    not searched. Other files are added to `left_out`.
    """
    found = searched(folder, ignored, left_out)
    if not found:
        raise InputError(f"{folder}: contains neither a series nor measurement files")
    return found


def searched(
    folder: Path, ignored: Container[str], left_out: list[tuple[str, str]]
) -> list[ComparedFile]:
    """Return the measurement files in a folder and its subfolders, which may be none."""
    series = trials(folder)
    if series:
        return [ComparedFile(folder / RECORDINGS / file, levels) for file, levels in series.items()]
    if (folder / JOURNAL).exists():
        raise InputError(f"{folder}: no trial of this series is done")
    found = []
    try:
        inside = sorted(folder.iterdir(), key=in_numerical_order)
    except OSError as error:
        raise unreadable(folder, error) from error
    for path in inside:
        if path.name.startswith(".") or os.path.realpath(path) in ignored:
            continue
        if is_measurement(path):
            found.append(of_file(path))
        elif path.is_dir():
            if path.suffix != FAULT_REPORT and not path.is_symlink():
                found += searched(path, ignored, left_out)
        else:
            left_out.append((str(path), NO_MEASUREMENT))
    return found


def in_numerical_order(path: Path) -> list[tuple[int, str]]:
    """Return the key that sorts files by their names, with numbers by their values."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part) if part.isdecimal() else 0, part) for part in parts]


def of_file(path: Path) -> ComparedFile:
    """Return a file, with the levels of its factors if it is a recording of a series."""
    folder = path.absolute().parent
    if folder.name != RECORDINGS:
        return ComparedFile(path)
    return ComparedFile(path, trials(folder.parent).get(path.name, {}))


def trials(folder: Path) -> dict[str, dict[str, str]]:
    """Return the levels of each recording of a series, from its journal or table; else empty."""
    for name, read in ((JOURNAL, journal_trials), (NAME, table_trials)):
        path = folder / name
        if path.exists():
            try:
                return read(path)
            except OSError as error:
                raise unreadable(path, error) from error
    return {}


def journal_trials(path: Path) -> dict[str, dict[str, str]]:
    """Read the levels of the recordings of trials that are done from the journal of a series."""
    try:
        journal = Journal(path.parent)
        order = cells(Plan.model_validate(journal.entries[0]["plan"]))
        found = {}
        for result in journal.results():
            problem = journal.problem_of_recording(result)
            if problem and (path.parent / RECORDINGS / result["file"]).exists():
                raise InputError(f"{path.parent}: {problem}; restore or remove it")
            levels, repetition = order[result["trial"] - 1]
            found[result["file"]] = levels | {"repetition": str(repetition)}
    except (IndexError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not the journal of a series") from error
    return found


def table_trials(path: Path) -> dict[str, dict[str, str]]:
    """Read the levels of the recordings from the table of the results (CSV) of a series."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return {row["file"]: dict(factors_of(row)) for row in csv.DictReader(file)}
    except (KeyError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: not the table of a series") from error


def planned_levels(found: Iterable[ComparedFile]) -> dict[str, list[str]]:
    """Return the levels of each factor, in the order of the plans of the series."""
    levels: dict[str, list[str]] = {}
    for folder in dict.fromkeys(
        source.path.absolute().parent.parent for source in found if source.levels
    ):
        for name, planned in plan_factors(folder / JOURNAL).items():
            levels[name] = [*dict.fromkeys([*levels.get(name, ()), *planned])]
    return levels


def plan_factors(journal: Path) -> dict[str, list[str]]:
    """Return the levels of each factor in the plan of a series; empty without a journal."""
    try:
        with journal.open("rb") as file:
            factors = loads(file.readline())["plan"]["factors"]
        return {str(name): [str(level) for level in levels] for name, levels in factors.items()}
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise unreadable(journal, error) from error
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{journal}: not the journal of a series") from error


def factors_of(row: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Yield each factor and its level: the columns up to `repetition`, except `trial`."""
    for name in takewhile(lambda name: name != "repetition", row):
        if name != "trial":
            yield name, row[name]
    yield "repetition", row["repetition"]


def known_factors(source: ComparedFile, of_settings: Mapping[str, str]) -> dict[str, str]:
    """Return the levels of all factors by which a file can be grouped.

    These are its name and folder, those of its settings, and those that are stated for the file.
    """
    folder = source.path.absolute().parent.name
    return {"file": source.path.name, "folder": folder, **of_settings, **source.levels}


def setting_levels(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the settings of a recording that are texts or numbers, as levels of factors."""
    found = {}
    for name, value in stated_settings(settings).items():
        if isinstance(value, float):
            found[name] = f"{value:g}"
        elif isinstance(value, str | int) and value != "":
            found[name] = str(value)
    return found


def usual_factors(found: Iterable[ComparedFile], rows: Sequence[Compared]) -> list[str]:
    """Return the factors with several levels by which files are grouped, if nothing is stated.

    They are the factors of a series, a pattern or a table, and those that name the palpated body.
    """
    stated = dict.fromkeys(name for source in found for name in source.levels)
    return [
        name
        for name in (stated | dict.fromkeys(BODY))
        if name not in (SUBJECT, *REPETITIONS) and len({row.factors.get(name) for row in rows}) > 1
    ]


def stated_factors(found: Iterable[ComparedFile]) -> list[str]:
    """Return the factors that say how the files differ, except the number of the repetition."""
    stated = dict.fromkeys(name for source in found for name in source.levels)
    return [name for name in (stated | dict.fromkeys(BODY)) if name not in REPETITIONS]
