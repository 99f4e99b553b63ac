"""Export recordings to CSV, HDF5, MATLAB and Parquet files."""

from __future__ import annotations

import codecs
import csv
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

import numpy as np

from estimation.arrays import Floats
from teleop.errors import InputError
from teleop.files import new_file, write_text
from teleop.json_documents import dumps
from teleop.recording.recording import load
from teleop.recording.stream import RecordingStream
from telepalpation import needs


def write_csv(file: BinaryIO, recording: RecordingStream) -> None:
    """Write the columns as CSV, with the headers `name [unit]`."""
    writer = table_writer(file, recording.units)
    for columns in blocks(recording):
        writer.writerows(rows_of(columns))


def description_of(path: Path) -> Path | None:
    """Return the path of the JSON file that describes a CSV file; None for any other file.

    The standard "CSV on the Web" defines its name and its form.
    """
    is_csv = path.suffix.lower() in FORMATS and format_of(path) == "csv"
    return path.with_name(f"{path.name}-metadata.json") if is_csv else None


def description(path: Path, recording: RecordingStream) -> str:
    """Return a JSON document with settings, session data and events, to describe a CSV file.

    All blocks of the recording have been read. Before that, its events are not complete.
    """
    about = {
        "settings": recording.settings,
        "session": recording.session,
        "events": recording.events,
    }
    url = quote(os.fsencode(path.name))  # a name that is not text would make the JSON invalid
    document = {"@context": "http://www.w3.org/ns/csvw", "url": url, "notes": [about]}
    return dumps(document, indent=1) + "\n"


def write_hdf5(disk: BinaryIO, recording: RecordingStream) -> None:
    """Write one dataset per column, with the attribute `unit`; the other data are attributes."""
    try:
        import h5py
    except ImportError as error:
        raise missing("h5py", "HDF5") from error
    with h5py.File(disk, "w", track_order=True) as file:
        file.attrs.update(recording.session)
        file.attrs["settings"] = dumps(recording.settings)
        for name, unit in recording.units.items():
            file.create_dataset(name, (recording.ticks,), "f8").attrs["unit"] = unit
        start = 0
        for columns in blocks(recording):
            end = start + len(columns["time"])
            for name, values in columns.items():
                file[name][start:end] = values
            start = end
        events = [dumps(event) for event in recording.events]
        file.create_dataset("events", data=np.array(events, dtype=h5py.string_dtype()))


def write_matlab(file: BinaryIO, recording: RecordingStream) -> None:
    """Write one variable per column, and `units`, `session`, `settings` and `events`.

    In a MATLAB file, all values of a variable precede the next variable. The recording can
    therefore not be written in blocks of ticks, and must fit into memory.
    """
    from scipy.io import savemat

    whole = load(recording.path)
    about = {
        "units": recording.units,
        "session": recording.session,
        "settings": dumps(recording.settings),
        "events": dumps(recording.events),
    }
    savemat(file, {**whole.columns, **about}, long_field_names=True, oned_as="column")


def write_parquet(file: BinaryIO, recording: RecordingStream) -> None:
    """Write the columns with their units; the other data are metadata, as JSON documents."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise missing("pyarrow", "Parquet") from error
    fields = [
        pyarrow.field(name, pyarrow.float64(), metadata={"unit": unit})
        for name, unit in recording.units.items()
    ]
    about = {
        "session": dumps(recording.session),
        "settings": dumps(recording.settings),
        "events": dumps(recording.events),
    }
    schema = pyarrow.schema(fields, metadata=about)
    # Measured values hardly repeat: a dictionary of them would make file and memory larger.
    with parquet.ParquetWriter(file, schema, use_dictionary=False) as writer:
        for columns in blocks(recording):
            writer.write_table(pyarrow.table(columns, schema=schema))


FORMATS: dict[str, tuple[str, Callable[[BinaryIO, RecordingStream], None]]] = {
    ".csv": ("csv", write_csv),
    ".h5": ("hdf5", write_hdf5),
    ".hdf5": ("hdf5", write_hdf5),
    ".mat": ("matlab", write_matlab),
    ".parquet": ("parquet", write_parquet),
}
"""Name and write function of each export format, by the ending of the file name."""


def format_of(path: Path) -> str:
    """Return the name of the export format that the ending of a file name states."""
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected a file ending in .csv, .h5 (.hdf5), .mat or .parquet")
    return FORMATS[path.suffix.lower()][0]


def export_recording(file: Path, path: Path, overwrite: bool = False) -> RecordingStream:
    """Write a recording in the format that the ending of `path` states, and return it.

    The recording is read twice: first to check that it is complete, then to export it. A CSV file
    has only columns. `description_of` names the file with the other data.
    """
    format_of(path)
    recording = RecordingStream(file)
    for _ in recording.blocks(lambda name: False):
        pass
    with new_file(path, overwrite) as new:
        FORMATS[path.suffix.lower()][1](new, recording)
    if beside := description_of(path):
        write_text(beside, description(path, recording), overwrite)
    return recording


def blocks(recording: RecordingStream) -> Iterator[dict[str, Floats]]:
    """Read a recording again from its file, because a `RecordingStream` can be read only once."""
    return RecordingStream(recording.path).blocks()


def missing(library: str, name: str) -> InputError:
    """Return an error which states that the library of an export format is not installed."""
    return InputError(needs(name, library, "export"))


class TableFile:
    """A CSV file to which a table is written in blocks of rows, with all digits of each number."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._writer: Any = None

    def write(self, table: tuple[Mapping[str, Floats], Mapping[str, str]]) -> None:
        """Write the next rows: columns and units by name. The first call writes the header."""
        columns, units = table
        if self._writer is None:
            self._writer = table_writer(self._file, {name: units[name] for name in columns})
        self._writer.writerows(rows_of(columns))


def table_writer(file: BinaryIO, units: Mapping[str, str]) -> Any:
    """Write the header of a CSV table, and return a `csv.writer` for its rows."""
    writer = csv.writer(codecs.getwriter("utf-8")(file, "backslashreplace"))
    writer.writerow([f"{name} [{unit}]" for name, unit in units.items()])
    return writer


def rows_of(columns: Mapping[str, Floats]) -> Iterable[tuple[float, ...]]:
    """Return the rows of a table, as Python floats, which are written with all digits."""
    return zip(*(column.tolist() for column in columns.values()), strict=True)
