"""The formats of measurement files: which module reads a file of which ending."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from drivers.input_file import open_input
from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Pick, Table
from teleop.files import unreadable

ENDINGS = {
    ".csv": "delimited",
    ".tsv": "delimited",
    ".txt": "delimited",
    ".dat": "delimited",
    ".asc": "delimited",
}
"""Module of this package that reads a file of each ending."""
BEGINNINGS: dict[bytes, str] = {}
"""Module for a file of any other ending, by how it begins; text otherwise."""


def reader_of(path: Path) -> str:
    """Name of the module that reads a file.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    ending = path.suffix.lower()
    if ending in ENDINGS:
        return ENDINGS[ending]
    with open_input(path) as file:
        head = file.read(64)
    return next((name for mark, name in BEGINNINGS.items() if head.startswith(mark)), "delimited")


def read_tables(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """The tables of a measurement file.

    Parameters
    ----------
    path
        The file.
    pick
        Chooses the columns that are loaded of a table.
    wanted
        What the user asks.

    Raises
    ------
    InputError
        The file cannot be read, is not as its format demands, or a library is not installed.
    """
    try:
        module = import_module(f"{__package__}.{reader_of(path)}")
        tables: list[Table] = module.read(path, pick, wanted)
    except OSError as error:
        raise unreadable(path, error) from error
    if not tables:
        raise InputError(f"{path}: no table of numbers in it: expected columns of samples")
    return tables
