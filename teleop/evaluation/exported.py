"""Convert the tables of files that `teleop export` wrote back to recordings."""

from __future__ import annotations

import json
from typing import Any

from teleop.errors import InputError
from teleop.evaluation.formats.table import Table
from teleop.recording.recording import Recording, gaps_of

COLUMNS = ("time", "paired_position", "paired_force", "paired_dt", "x", "dt", "dropped")
"""Columns that every exported recording has. A table with these columns is treated as an exported
recording."""


def exported_recording(table: Table) -> Recording | None:
    """Return the recording that a table contains; None if the table is not an exported recording.

    Parameters
    ----------
    table
        A table from a file. A table with all columns in `COLUMNS` is an exported recording.

    Raises
    ------
    InputError
        A value or the stored settings cannot be read.
    """
    if not set(COLUMNS) <= {heading.name for heading in table.headings}:
        return None
    if len(table.columns) < len(table.headings):
        return None
    if table.problem:
        raise table.problem
    columns = {table.headings[i].name: column for i, column in table.columns.items()}
    return Recording(
        columns=columns,
        units={heading.name: heading.unit or "-" for heading in table.headings},
        events=stored(table, "events", []),
        session=stored(table, "session", {}),
        settings=stored(table, "settings", {}),
        gaps=gaps_of(columns),
    )


def stored(table: Table, name: str, default: Any) -> Any:
    """Return the value of a JSON document (for example the settings) in an exported table.

    Parameters
    ----------
    table
        The exported table.
    name
        Name of the document, for example `settings`.
    default
        Value to return if there is no such document, or if the type of its value is not that of
        `default`.

    Raises
    ------
    InputError
        The document is not valid JSON.
    """
    try:
        value = json.loads(table.about.get(name, "null"))
    except ValueError as error:
        raise InputError(f"{table.where}: the {name} of the run are not JSON: {error}") from error
    return value if isinstance(value, type(default)) else default
