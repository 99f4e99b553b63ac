"""Find the recordings that are to be compared, and the levels of the factors of each recording.

A level of a factor is its value for a recording, for example `mimic`. The folder of a series
contains the journal (a file with a line for each event), the table of the results (a CSV file), and
the folder of the recordings.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from teleop.evaluation.across.comparison import SUBJECT
from teleop.files import RECORDING, unreadable
from teleop.json_documents import loads
from teleop.recording.recording import stated_settings
from teleop.studies.series.journal import NAME as JOURNAL
from teleop.studies.series.journal import RECORDINGS, Journal
from teleop.studies.series.plan import Plan
from teleop.studies.series.table import NAME
from teleop.studies.series.trials import cells


@dataclass(frozen=True)
class Source:
    """A file that is to be compared with other files, and the levels of its factors."""

    path: Path
    """The file."""
    levels: dict[str, str] = field(default_factory=dict)
    """Level of each factor of the series to which the file belongs, by the name of the factor. If
    the file belongs to no series, the dictionary is empty."""


def sources(paths: Iterable[Path]) -> list[Source]:
    """Return the files that are to be compared."""
    found: dict[str, Source] = {}
    for path in paths:
        for source in of_folder(path) if path.is_dir() else [of_file(path)]:
            name = str(source.path.resolve())
            if name in found:
                raise InputError(f"{source.path} is named twice: expected different recordings")
            found[name] = source
    return [*found.values()]


def of_folder(folder: Path) -> list[Source]:
    """Return the recordings in a folder, with the levels of their factors.

    In the folder of a series, only the recordings of trials that are done are returned.
    """
    series = trials(folder)
    if series:
        return [Source(folder / RECORDINGS / file, levels) for file, levels in series.items()]
    if (folder / JOURNAL).exists():
        raise InputError(f"{folder}: no trial of this series is done")
    try:
        inside = folder / RECORDINGS
        files = sorted(
            path
            for place in (folder, *([inside] if inside.is_dir() else []))
            for path in place.iterdir()
            if path.suffix.lower() == RECORDING
        )
    except OSError as error:
        raise unreadable(folder, error) from error
    if not files:
        raise InputError(f"{folder}: contains neither a series nor recordings (*{RECORDING})")
    return [of_file(path) for path in files]


def of_file(path: Path) -> Source:
    """Return a file, with the levels of its factors if it is a recording of a series.

    A file that is not part of a series is returned without levels.
    """
    folder = path.absolute().parent
    if folder.name != RECORDINGS:
        return Source(path)
    return Source(path, trials(folder.parent).get(path.name, {}))


def trials(folder: Path) -> dict[str, dict[str, str]]:
    """Return the levels of the factors of each recording in the folder of a series.

    The levels are read from the journal of the series. If there is no journal, they are read from
    the table of the results (CSV). If the folder contains neither of these files, the result is
    empty.
    """
    for name, read in ((JOURNAL, journal_trials), (NAME, table_trials)):
        path = folder / name
        if path.exists():
            try:
                return read(path)
            except OSError as error:
                raise unreadable(path, error) from error
    return {}


def journal_trials(path: Path) -> dict[str, dict[str, str]]:
    """Read the levels of the factors of each recording from the journal of a series.

    `path` is the path of the journal, a file with a line for each event of the series. The levels
    are returned by the file name of the recording, for trials that are done.
    """
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
    """Read the levels of the factors of each recording from the table of the results (CSV).

    `path` is the path of the table of a series. The levels are returned by the file name of the
    recording.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return {row["file"]: dict(factors_of(row)) for row in csv.DictReader(file)}
    except (KeyError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: not the table of a series") from error


def planned_levels(found: Iterable[Source]) -> dict[str, list[str]]:
    """Return the levels of each factor, in the order in which the plans of the series list them.

    The plan of a series is read from the journal in the folder of the series.
    """
    levels: dict[str, list[str]] = {}
    for folder in dict.fromkeys(
        source.path.absolute().parent.parent for source in found if source.levels
    ):
        for name, planned in plan_factors(folder / JOURNAL).items():
            levels[name] = [*dict.fromkeys([*levels.get(name, ()), *planned])]
    return levels


def plan_factors(journal: Path) -> dict[str, list[str]]:
    """Return the levels of each factor of a series, by the name of the factor.

    The levels are read from the plan of the series, which is in the first line of the journal. If
    the journal does not exist, the result is empty.
    """
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
    """Yield each factor and its level, from a row of the table of the results of a series (CSV).

    The first columns of the table contain the factors, up to and including the column `repetition`.
    The column `trial` is not a factor.
    """
    for name in takewhile(lambda name: name != "repetition", row):
        if name != "trial":
            yield name, row[name]
    yield "repetition", row["repetition"]


def known_factors(source: Source, settings: Mapping[str, Any]) -> dict[str, str]:
    """Return all factors by which a file can be grouped, with the level of each factor.

    The factors are the name of the file, the name of its folder, all settings of the trial whose
    value is a text or a number, and the factors of the series to which the file belongs.
    """
    found = {"file": source.path.name, "folder": source.path.absolute().parent.name}
    for name, value in stated_settings(settings).items():
        if isinstance(value, float):
            found[name] = f"{value:g}"
        elif isinstance(value, str | int) and value != "":
            found[name] = str(value)
    return found | source.levels


def usual_factors(found: Iterable[Source]) -> list[str]:
    """Return the factors by which the files are grouped if the user does not choose factors.

    These are the factors of a series that have two or more levels in the given files. The factors
    `subject` and `repetition` are omitted.
    """
    levels: dict[str, set[str]] = {}
    for source in found:
        for name, level in source.levels.items():
            levels.setdefault(name, set()).add(level)
    return [
        name
        for name, distinct in levels.items()
        if name not in (SUBJECT, "repetition") and len(distinct) > 1
    ]
