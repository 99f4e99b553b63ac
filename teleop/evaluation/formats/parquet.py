"""Parquet files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from drivers.input_file import open_input
from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.evaluation.formats.arrays import table_of, texts, vectors
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Pick, Table, missing


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """The table in a Parquet file; the metadata `unit` of a column has its unit."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise missing("pyarrow", "Parquet") from error
    with open_input(path) as file:
        try:
            content = parquet.read_table(file)
        except (pyarrow.ArrowInvalid, pyarrow.ArrowNotImplementedError) as error:
            raise InputError(f"{path}: cannot be read as Parquet: {error}") from error
    columns: dict[str, Floats] = {}
    units: dict[str, Any] = {}
    for field in content.schema:
        try:
            values = content.column(field.name).to_numpy()
        except (pyarrow.ArrowInvalid, pyarrow.ArrowNotImplementedError, KeyError):
            continue
        columns.update(vectors(field.name, values))
        units[field.name] = (field.metadata or {}).get(b"unit")
    about = {key.decode(): value for key, value in (content.schema.metadata or {}).items()}
    exported = texts(about, ("settings", "session", "events", "force_filter"))
    return [table_of(path, str(path), columns, pick, units, "", exported)] if columns else []
