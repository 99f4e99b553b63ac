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
class ComparedFile:
    """A file that is to be compared with other files, and the levels of its factors."""

    path: Path
    """The file."""
    levels: dict[str, str] = field(default_factory=dict)
    """Level of each factor of the series to which the file belongs, by the name of the factor. If
    the file belongs to no series, the dictionary is empty."""


def sources(paths: Iterable[Path]) -> list[ComparedFile]:
    """Return the files that are to be compared."""
    found: dict[str, ComparedFile] = {}
    for path in paths:
        for source in of_folder(path) if path.is_dir() else [of_file(path)]:
            name = str(source.path.resolve())
            if name in found:
                raise InputError(f"{source.path} is named twice: expected different recordings")
            found[name] = source
    return [*found.values()]


def of_folder(folder: Path) -> list[ComparedFile]:
    """Return the recordings in a folder; of a series, only those of trials that are done."""
    series = trials(folder)
    if series:
        return [ComparedFile(folder / RECORDINGS / file, levels) for file, levels in series.items()]
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


def known_factors(source: ComparedFile, settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the levels of all factors by which a file can be grouped.

    These are its name and folder, the settings that are texts or numbers, and those of its series.
    """
    found = {"file": source.path.name, "folder": source.path.absolute().parent.name}
    for name, value in stated_settings(settings).items():
        if isinstance(value, float):
            found[name] = f"{value:g}"
        elif isinstance(value, str | int) and value != "":
            found[name] = str(value)
    return found | source.levels


def usual_factors(found: Iterable[ComparedFile]) -> list[str]:
    """Return the factors of a series with several levels; files are grouped by them."""
    levels: dict[str, set[str]] = {}
    for source in found:
        for name, level in source.levels.items():
            levels.setdefault(name, set()).add(level)
    return [
        name
        for name, distinct in levels.items()
        if name not in (SUBJECT, "repetition") and len(distinct) > 1
    ]
