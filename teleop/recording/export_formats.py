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
    """Write the columns with the header `name [unit]`; `description` has the rest."""
    write_table(file, recording.columns, recording.units)


def description_of(path: Path) -> Path | None:
    """The file beside a CSV file that has what its columns do not, as CSV on the Web names it."""
    is_csv = path.suffix.lower() in FORMATS and format_of(path) == "csv"
    return path.with_name(f"{path.name}-metadata.json") if is_csv else None


def description(path: Path, recording: Recording) -> str:
    """The settings, session and events of a CSV file, as notes of CSV on the Web."""
    about = {
        "settings": recording.settings,
        "session": recording.session,
        "events": recording.events,
    }
    document = {"@context": "http://www.w3.org/ns/csvw", "url": path.name, "notes": [about]}
    return dumps(document, indent=1) + "\n"


def write_hdf5(disk: BinaryIO, recording: Recording) -> None:
    """Write a dataset with its unit per column, the session as attributes, and `events`.

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
    """Write a variable per column, and `units`, `session`, `settings` and `events`."""
    from scipy.io import savemat

    about = {
        "units": recording.units,
        "session": recording.session,
        "settings": dumps(recording.settings),
        "events": dumps(recording.events),
    }
    savemat(file, {**recording.columns, **about}, long_field_names=True, oned_as="column")


def write_parquet(file: BinaryIO, recording: Recording) -> None:
    """Write the columns with their units; session and events become metadata of the file.

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
"""Name and writing function of each format, by the file name's ending."""


def format_of(path: Path) -> str:
    """Return the name of the export format for a file name's ending.

    Raises
    ------
    InputError
        The ending is unknown.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected a file ending in .csv, .h5 (.hdf5), .mat or .parquet")
    return FORMATS[path.suffix.lower()][0]


def export_recording(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write a recording in the format of the file name's ending.

    Beside a CSV file goes one with the settings, session and events, `description_of`.

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
        The file cannot be written or exists, its ending is unknown, or a library is not
        installed.
    """
    format_of(path)
    with new_file(path, overwrite) as file:
        FORMATS[path.suffix.lower()][1](file, recording)
    if beside := description_of(path):
        write_text(beside, description(path, recording), overwrite)


def missing(library: str, name: str) -> InputError:
    """Return the error for a library that is not installed, with the command to install it."""
    return InputError(f"{name} needs {library}: pip install '.[export]'")


def write_table(file: BinaryIO, columns: Mapping[str, Floats], units: Mapping[str, str]) -> None:
    """Write columns, each of shape (n,), as CSV with all digits of each number."""
    header = [f"{name} [{units[name]}]" for name in columns]
    rows: Iterable[tuple[float, ...]] = zip(*(c.tolist() for c in columns.values()), strict=True)
    writer = csv.writer(codecs.getwriter("utf-8")(file, "backslashreplace"))
    writer.writerow(header)
    writer.writerows(rows)
