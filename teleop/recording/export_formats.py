"""Export of recordings to CSV, HDF5, MATLAB and Parquet files."""

from __future__ import annotations

import codecs
import csv
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.files import new_file, write_text
from teleop.json_documents import dumps

if TYPE_CHECKING:
    from teleop.recording.recording import Recording


def write_csv(file: BinaryIO, recording: Recording) -> None:
    """Write the columns of a recording as CSV, each with the header `name [unit]`.

    Settings, session and events are not part of the CSV file, see `description`.
    """
    write_table(file, recording.columns, recording.units)


def description_of(path: Path) -> Path | None:
    """Return the path of the description of a CSV file; None for another format.

    The name of the description is defined by the standard CSV on the Web.
    """
    is_csv = path.suffix.lower() in FORMATS and format_of(path) == "csv"
    return path.with_name(f"{path.name}-metadata.json") if is_csv else None


def description(path: Path, recording: Recording) -> str:
    """Return the settings, session and events of a recording as a JSON document.

    The document describes a CSV file as defined by the standard CSV on the Web.

    Parameters
    ----------
    path
        The CSV file that the document describes.
    recording
        The recording.
    """
    about = {
        "settings": recording.settings,
        "session": recording.session,
        "events": recording.events,
    }
    document = {"@context": "http://www.w3.org/ns/csvw", "url": path.name, "notes": [about]}
    return dumps(document, indent=1) + "\n"


def write_hdf5(disk: BinaryIO, recording: Recording) -> None:
    """Write an HDF5 file with one dataset per column, which has the attribute `unit`.

    The session and the settings are attributes of the file. The dataset `events` contains the
    events as JSON documents.

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
        for name, column in recording.columns.items():
            file.create_dataset(name, data=column).attrs["unit"] = recording.units[name]
        events = [dumps(event) for event in recording.events]
        file.create_dataset("events", data=np.array(events, dtype=h5py.string_dtype()))


def write_matlab(file: BinaryIO, recording: Recording) -> None:
    """Write a MATLAB file with one variable per column.

    The variables `units`, `session`, `settings` and `events` contain the other data.
    """
    from scipy.io import savemat

    about = {
        "units": recording.units,
        "session": recording.session,
        "settings": dumps(recording.settings),
        "events": dumps(recording.events),
    }
    savemat(file, {**recording.columns, **about}, long_field_names=True, oned_as="column")


def write_parquet(file: BinaryIO, recording: Recording) -> None:
    """Write the columns with their units to a Parquet file.

    Session, settings and events are metadata of the file, as JSON documents.

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
        pyarrow.field(name, pyarrow.float64(), metadata={"unit": recording.units[name]})
        for name in recording.columns
    ]
    about = {
        "session": dumps(recording.session),
        "settings": dumps(recording.settings),
        "events": dumps(recording.events),
    }
    columns = [pyarrow.array(column) for column in recording.columns.values()]
    table = pyarrow.Table.from_arrays(columns, schema=pyarrow.schema(fields, metadata=about))
    parquet.write_table(table, file)


FORMATS: dict[str, tuple[str, Callable[[BinaryIO, Recording], None]]] = {
    ".csv": ("csv", write_csv),
    ".h5": ("hdf5", write_hdf5),
    ".hdf5": ("hdf5", write_hdf5),
    ".mat": ("matlab", write_matlab),
    ".parquet": ("parquet", write_parquet),
}
"""Name and write function of each export format, by the ending of the file name."""


def format_of(path: Path) -> str:
    """Return the name of the export format that the ending of a file name selects.

    Raises
    ------
    InputError
        The ending is unknown.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected a file ending in .csv, .h5 (.hdf5), .mat or .parquet")
    return FORMATS[path.suffix.lower()][0]


def export_recording(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write a recording in the format that the ending of the file name selects.

    For a CSV file, the settings, session and events are written to the additional file
    `description_of`.

    Parameters
    ----------
    path
        The file.
    recording
        The recording to write.
    overwrite
        Whether to overwrite an existing file.

    Raises
    ------
    InputError
        The file cannot be written, exists and may not be overwritten, its ending is unknown, or a
        library is not installed.
    """
    format_of(path)
    with new_file(path, overwrite) as file:
        FORMATS[path.suffix.lower()][1](file, recording)
    if beside := description_of(path):
        write_text(beside, description(path, recording), overwrite)


def missing(library: str, name: str) -> InputError:
    """Return the error for a format whose library is not installed.

    Parameters
    ----------
    library
        Name of the library.
    name
        Name of the format.
    """
    return InputError(f"{name} needs {library}: pip install '.[export]'")


def write_table(file: BinaryIO, columns: Mapping[str, Floats], units: Mapping[str, str]) -> None:
    """Write columns as CSV, with all digits of each number.

    Parameters
    ----------
    file
        The open file.
    columns
        Columns by name, each of shape (n,).
    units
        Unit of each column, by its name.
    """
    header = [f"{name} [{units[name]}]" for name in columns]
    rows: Iterable[tuple[float, ...]] = zip(*(c.tolist() for c in columns.values()), strict=True)
    writer = csv.writer(codecs.getwriter("utf-8")(file, "backslashreplace"))
    writer.writerow(header)
    writer.writerows(rows)
