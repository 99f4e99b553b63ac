"""Find the recordings that are compared, and the level of each factor for each of them."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from teleop.evaluation.comparison import SUBJECT
from teleop.files import RECORDING, unreadable
from teleop.json_documents import loads
from teleop.studies.series.journal import NAME as JOURNAL
from teleop.studies.series.journal import RECORDINGS, Journal
from teleop.studies.series.plan import Plan
from teleop.studies.series.table import NAME
from teleop.studies.series.trials import cells


@dataclass(frozen=True)
class Source:
    """A file that is compared, with the level of each factor."""

    path: Path
    """The file."""
    levels: dict[str, str] = field(default_factory=dict)
    """Level of each factor of the series to which the file belongs; empty if it belongs to no
    series."""


def sources(paths: Iterable[Path]) -> list[Source]:
    """Return the files that are compared.

    Parameters
    ----------
    paths
        Files and folders. For the folder of a series, the recordings of the trials that are done
        are returned. For any other folder, all recordings in it and in its subfolder `recordings`
        are returned.

    Raises
    ------
    InputError
        A folder contains no recordings or cannot be read, or a file is given twice.
    """
    found: dict[str, Source] = {}
    for path in paths:
        for source in of_folder(path) if path.is_dir() else [of_file(path)]:
            name = str(source.path.resolve())
            if name in found:
                raise InputError(f"{source.path} is named twice: expected different recordings")
            found[name] = source
    return [*found.values()]


def of_folder(folder: Path) -> list[Source]:
    """Return the recordings in a folder.

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
    """Return a file with the levels of its factors; no levels if it is not part of a series."""
    folder = path.absolute().parent
    if folder.name != RECORDINGS:
        return Source(path)
    return Source(path, trials(folder.parent).get(path.name, {}))


def trials(folder: Path) -> dict[str, dict[str, str]]:
    """Return the levels of the factors for each recording of a series, by its file name.

    The levels are read from the journal of the series. If there is no journal, they are read from
    the table of the series. The result is empty if the folder contains neither of these files.

    Raises
    ------
    InputError
        The journal or the table of the series cannot be read.
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
    """Return the levels of the factors for each recording in the journal of a series."""
    try:
        journal = Journal(path.parent)
        order = cells(Plan.model_validate(journal.entries[0]["plan"]))
        found = {}
        for result in journal.results():
            levels, repetition = order[result["trial"] - 1]
            found[result["file"]] = levels | {"repetition": str(repetition)}
    except (IndexError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not the journal of a series") from error
    return found


def table_trials(path: Path) -> dict[str, dict[str, str]]:
    """Return the levels of the factors for each recording in the table of a series."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return {row["file"]: dict(factors_of(row)) for row in csv.DictReader(file)}
    except (KeyError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: not the table of a series") from error


def planned_levels(found: Iterable[Source]) -> dict[str, list[str]]:
    """Return the levels of the factors in the order of the plans of the series.

    Parameters
    ----------
    found
        Files. The plan of a series is read from the journal in its folder. A file that belongs to
        no series, and a series without a journal, have no plan.

    Raises
    ------
    InputError
        A journal cannot be read.
    """
    levels: dict[str, list[str]] = {}
    for folder in dict.fromkeys(
        source.path.absolute().parent.parent for source in found if source.levels
    ):
        for name, planned in plan_factors(folder / JOURNAL).items():
            levels[name] = [*dict.fromkeys([*levels.get(name, ()), *planned])]
    return levels


def plan_factors(journal: Path) -> dict[str, list[str]]:
    """Return the factors of the plan in the first line of a journal, with the levels of each."""
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
    """Yield each factor and its level, from a row of the table of a series.

    The first columns of the table contain the factors, up to and including the column `repetition`.
    The column `trial` is not a factor.
    """
    for name in takewhile(lambda name: name != "repetition", row):
        if name != "trial":
            yield name, row[name]
    yield "repetition", row["repetition"]


def known_factors(source: Source, settings: Mapping[str, Any]) -> dict[str, str]:
    """Return all factors by which a file can be grouped, with the level of each factor.

    The factors are the name and the folder of the file, the settings of the recorded trial that are
    a text or a number, and the factors of the series.

    Parameters
    ----------
    source
        The file.
    settings
        Settings of the recorded trial by name; empty for a file of another program.
    """
    found = {"file": source.path.name, "folder": source.path.absolute().parent.name}
    for name, value in settings.items():
        if isinstance(value, float):
            found[name] = f"{value:g}"
        elif isinstance(value, str | int) and value != "":
            found[name] = str(value)
    return found | source.levels


def usual_factors(found: Iterable[Source]) -> list[str]:
    """Return the factors of a series that have two or more levels in the given files.

    The factors subject and repetition are omitted.
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
