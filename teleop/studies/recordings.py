"""The recordings that a comparison is given: files, series and folders, with their factors."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from teleop.files import RECORDING, unreadable
from teleop.studies.series.table import NAME, RECORDINGS

SUBJECT = "subject"
"""Factor whose levels are persons or specimens drawn at random."""


@dataclass(frozen=True)
class Source:
    """A file that is compared."""

    path: Path
    """The file."""
    levels: dict[str, str] = field(default_factory=dict)
    """Level of each factor of its series; empty for a file that is not part of one."""


def sources(paths: Iterable[Path]) -> list[Source]:
    """Return the files that paths name.

    Parameters
    ----------
    paths
        Files; folders of series, of which each trial in `trials.csv` is taken; or other folders,
        of which each recording is taken.

    Raises
    ------
    InputError
        A folder has no recordings or cannot be read, or a file is named twice.
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
    """Return the recordings of a series or of another folder."""
    series = trials(folder)
    if series:
        return [Source(folder / RECORDINGS / file, levels) for file, levels in series.items()]
    try:
        files = sorted(path for path in folder.iterdir() if path.suffix.lower() == RECORDING)
    except OSError as error:
        raise unreadable(folder, error) from error
    if not files:
        raise InputError(f"{folder}: has neither {NAME} nor recordings (*{RECORDING})")
    return [of_file(path) for path in files]


def of_file(path: Path) -> Source:
    """Return a file, with its factors if it is the recording of a trial of a series."""
    folder = path.absolute().parent
    if folder.name != RECORDINGS:
        return Source(path)
    return Source(path, trials(folder.parent).get(path.name, {}))


def trials(folder: Path) -> dict[str, dict[str, str]]:
    """Return the levels of the trials of a series by the names of their recordings.

    Raises
    ------
    InputError
        The table of the series cannot be read.
    """
    path = folder / NAME
    if not path.exists():
        return {}
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [*csv.DictReader(file)]
        return {row["file"]: dict(factors_of(row)) for row in rows}
    except OSError as error:
        raise unreadable(path, error) from error
    except (KeyError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: not the table of a series") from error


def factors_of(row: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Yield the levels in a row of the table of a series: its columns up to the repetition."""
    for name in takewhile(lambda name: name != "repetition", row):
        if name != "trial":
            yield name, row[name]
    yield "repetition", row["repetition"]


def known_factors(source: Source, settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the factors by which a file can be grouped.

    These are its name and folder, the settings of a recorded trial that are a text or a number,
    and the factors of its series.
    """
    found = {"file": source.path.name, "folder": source.path.absolute().parent.name}
    for name, value in settings.items():
        if isinstance(value, float):
            found[name] = f"{value:g}"
        elif isinstance(value, str | int) and value != "":
            found[name] = str(value)
    return found | source.levels


def usual_factors(found: Iterable[Source]) -> list[str]:
    """Return the factors of the series with two levels or more, other than the subject."""
    levels: dict[str, set[str]] = {}
    for source in found:
        for name, level in source.levels.items():
            levels.setdefault(name, set()).add(level)
    return [
        name
        for name, distinct in levels.items()
        if name not in (SUBJECT, "repetition") and len(distinct) > 1
    ]
