"""Detect the format of a measurement file, and read the file with the module for this format.

To add a format, write a module in this folder with a function `read(path, pick, wanted)`, and add
the first bytes of its files to `BEGINNINGS`. If another library reads the format, also add it to
`FOREIGN`, so that it is read in a separate process.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from drivers.input_file import open_input
from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Pick, Table
from teleop.files import unreadable

BEGINNINGS = {
    b"LabVIEW Measurement": "lvm",
    b"MATLAB ": "matlab",
    b"\x89HDF": "hdf5",
    b"PAR1": "parquet",
    b"TDSm": "tdms",
    b"PK\x03\x04": "excel",
    b"\xd0\xcf\x11\xe0": "excel",
    b"\x89MCAP": "mcap",
    b"#ROSBAG": "bag",
}
"""Module that reads a file, by the first bytes of the file; `delimited` for all other files."""
FOREIGN = {
    "matlab": "a MATLAB file",
    "hdf5": "HDF5",
    "parquet": "Parquet",
    "tdms": "TDMS",
    "excel": "a spreadsheet",
    "mcap": "MCAP",
    "bag": "a ROS bag",
}
"""Name of each format that a foreign library reads, for messages, by its module."""
OF_MESSAGES = ("mcap", "bag")
"""Modules that read files of messages, which have topics."""
ROS_2_BAG = "metadata.yaml"
"""Name of a file that every folder of a ROS 2 bag contains."""


def reader_of(path: Path) -> str:
    """Return the name of the module in this package that reads a file.

    The module is chosen by the first bytes of the file (see `BEGINNINGS`). The ending of the file
    name is ignored, because testing machines write text files named .xls or .dat.
    """
    if path.is_dir() and (path / ROS_2_BAG).is_file():
        return "bag"
    with open_input(path) as file:
        head = file.read(64)
    return next((name for mark, name in BEGINNINGS.items() if head.startswith(mark)), "delimited")


def read_tables(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read the tables of a measurement file."""
    try:
        name = reader_of(path)
        if wanted.topic and name not in OF_MESSAGES:
            raise InputError(f"{path}: --topic is for a ROS bag or an MCAP file")
        if name in FOREIGN:
            from teleop.evaluation.formats.reader_process import read_apart

            tables = read_apart(name, FOREIGN[name], path, pick, wanted)
        else:
            tables = import_module(f"{__package__}.{name}").read(path, pick, wanted)
    except OSError as error:
        raise unreadable(path, error) from error
    if not tables:
        raise InputError(f"{path}: the file has no table of numbers: expected columns of samples")
    return tables
