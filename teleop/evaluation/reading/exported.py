"""Convert the tables of files that `teleop export` wrote back to recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from teleop.errors import InputError
from teleop.evaluation.formats.table import Table
from teleop.json_documents import loads_any

if TYPE_CHECKING:
    from teleop.recording.recording import Recording

COLUMNS = {
    "time": "s",
    "paired_position": "m",
    "paired_force": "N",
    "paired_dt": "s",
    "x": "m",
    "dt": "s",
    "dropped": "-",
}
"""Columns that every exported recording has, and their units. A table with these columns is treated
as an exported recording."""


def exported_recording(table: Table) -> Recording | None:
    """Return the recording that a table contains; None if it is not an exported recording."""
    if not set(COLUMNS) <= {heading.name for heading in table.headings}:
        return None
    if len(table.columns) < len(table.headings):
        return None
    from teleop.recording.mcap_checks import check_event
    from teleop.recording.recording import Recording, gaps_of
    from teleop.recording.schema import check_schema

    if table.problem:
        raise table.problem
    for name, unit in table.headings:
        if unit and unit != COLUMNS.get(name, unit):
            raise InputError(
                f"{table.where}: column {name!r} is in {unit!r}: expected {COLUMNS[name]!r}, "
                "as teleop export writes it"
            )
    columns = {table.headings[i].name: column for i, column in table.columns.items()}
    events = stored(table, "events", [])
    try:
        for event in events:
            check_event(event)
    except ValueError as error:
        raise InputError(f"{table.where}: the events of the run: {error}") from error
    session = stored(table, "session", {})
    check_schema(table.where, session)
    return Recording(
        columns=columns,
        units={heading.name: heading.unit or "-" for heading in table.headings},
        events=events,
        session=session,
        settings=stored(table, "settings", {}),
        gaps=gaps_of(columns),
    )


def stored(table: Table, name: str, default: Any) -> Any:
    """Return the value of a JSON document (for example the settings) in an exported table."""
    if name not in table.about:
        return default
    try:
        value = loads_any(table.about[name])
    except ValueError as error:
        raise InputError(f"{table.where}: the {name} of the run are not JSON: {error}") from error
    if not isinstance(value, type(default)):
        form = "an object" if isinstance(default, dict) else "a list"
        raise InputError(f"{table.where}: the {name} of the run: expected {form} in JSON")
    return value
