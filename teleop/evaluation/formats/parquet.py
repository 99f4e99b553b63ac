"""Read Parquet files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from drivers.input_file import open_input
from teleop.evaluation.formats.arrays import table_of, texts, vectors
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Pick, Table, missing

if TYPE_CHECKING:
    from estimation.arrays import Floats


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read a Parquet file as one table. The unit of a column is read from its metadata `unit`."""
    try:
        from pyarrow import parquet, types
    except ImportError as error:
        raise missing("pyarrow", "Parquet") from error
    columns: dict[str, Floats] = {}
    units: dict[str, Any] = {}
    with open_input(path) as file:
        content = parquet.read_table(file)
        for field in content.schema:
            kind = field.type
            if types.is_primitive(kind) and not types.is_time(kind):
                columns.update(vectors(field.name, content.column(field.name).to_numpy()))
                units[field.name] = (field.metadata or {}).get(b"unit")
        about = {key.decode(): value for key, value in (content.schema.metadata or {}).items()}
    exported = texts(about, ("settings", "session", "events", "force_filter"))
    return [table_of(path, str(path), columns, pick, units, "", exported)] if columns else []
