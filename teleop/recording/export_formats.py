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


def write_csv(file: BinaryIO, recording: RecordingStream) -> None:
    """Write the columns of a recording as CSV. The header of each column is `name [unit]`.

    Settings, session data and events are not written. `description` returns them as a document for
    a separate file.
    """
    writer = table_writer(file, recording.units)
    for columns in blocks(recording):
        writer.writerows(rows_of(columns))


def description_of(path: Path) -> Path | None:
    """Return the path of the JSON file that describes a CSV file; None for any other file.

    The standard "CSV on the Web" defines the name of the JSON file.
    """
    is_csv = path.suffix.lower() in FORMATS and format_of(path) == "csv"
    return path.with_name(f"{path.name}-metadata.json") if is_csv else None


def description(path: Path, recording: RecordingStream) -> str:
    """Return a JSON document with the settings, the session data and the events of a recording.

    The document describes a CSV file that contains the columns of the recording. The standard "CSV
    on the Web" defines the form of the document.

    Parameters
    ----------
    path
        The CSV file.
    recording
        The recording. The caller has already read all its blocks. Before that, its events are not
        complete.
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
    """Write an HDF5 file with one dataset per column. Each dataset has the attribute `unit`.

    The session data (for example date and rig) and the settings are attributes of the file. The
    dataset `events` contains the events as JSON documents.

    Raises
    ------
    InputError
        h5py is not installed.
    """
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
    """Write a MATLAB file with one variable per column.

    The variables `units`, `session`, `settings` and `events` contain the other data. In a MATLAB
    file, all values of a variable precede the next variable. The recording can therefore not be
    written in blocks of ticks, and must fit into memory.

    Raises
    ------
    InputError
        The recording is too large for the memory of this machine.
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
    """Write the columns with their units to a Parquet file.

    The session data (for example date and rig), the settings and the events are metadata of the
    file, as JSON documents.

    Raises
    ------
    InputError
        pyarrow is not installed.
    """
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
    """Return the name of the export format that the ending of a file name states.

    Raises
    ------
    InputError
        The ending is unknown.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected a file ending in .csv, .h5 (.hdf5), .mat or .parquet")
    return FORMATS[path.suffix.lower()][0]


def export_recording(file: Path, path: Path, overwrite: bool = False) -> RecordingStream:
    """Write a recording to a file in the format that the ending of `path` determines.

    If the new file is a CSV file, it contains only the columns of the recording. The settings, the
    session data (for example date and rig) and the events are then written to an additional file.
    `description_of` returns the path of this file.

    Parameters
    ----------
    file
        The recording. It is read twice: first to check that it is complete, then to export it.
    path
        The file to write.
    overwrite
        Whether to overwrite an existing file.

    Returns
    -------
    The recording. It has been read completely, so that its events and gaps are known.

    Raises
    ------
    InputError
        The recording cannot be read, or is not complete. The ending of the new file is unknown. The
        new file cannot be written, or exists and may not be overwritten. The library of the format
        is not installed.
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
    """Read a recording again from its file, because a `RecordingStream` can be read only once.

    Yields
    ------
    The columns by name for each block of n successive ticks, each of shape (n,).
    """
    return RecordingStream(recording.path).blocks()


def missing(library: str, name: str) -> InputError:
    """Return an error which states that the library for an export format is not installed.

    Parameters
    ----------
    library
        Name of the library, for example `h5py`.
    name
        Name of the format, for example HDF5.
    """
    return InputError(f"{name} needs {library}: pip install '.[export]'")


class TableFile:
    """A CSV file to which a table is written in blocks of rows, with all digits of each number.

    Parameters
    ----------
    file
        The file, open for writing bytes.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._writer: Any = None

    def write(self, table: tuple[Mapping[str, Floats], Mapping[str, str]]) -> None:
        """Write the next n rows of the table. The first call also writes the header.

        Parameters
        ----------
        table
            Two mappings, whose keys are the names of the columns. The first mapping contains the
            values of each column, shape (n,). The second mapping contains the unit of each column.
        """
        columns, units = table
        if self._writer is None:
            self._writer = table_writer(self._file, {name: units[name] for name in columns})
        self._writer.writerows(rows_of(columns))


def table_writer(file: BinaryIO, units: Mapping[str, str]) -> Any:
    """Write the header of a CSV table, and return a `csv.writer` for its rows.

    Parameters
    ----------
    file
        The file, open for writing bytes.
    units
        Unit of each column, by the name of the column.
    """
    writer = csv.writer(codecs.getwriter("utf-8")(file, "backslashreplace"))
    writer.writerow([f"{name} [{unit}]" for name, unit in units.items()])
    return writer


def rows_of(columns: Mapping[str, Floats]) -> Iterable[tuple[float, ...]]:
    """Return the rows of a table whose columns are arrays.

    The values in the rows are Python floats, which the CSV writer writes with all digits.
    """
    return zip(*(column.tolist() for column in columns.values()), strict=True)
