"""Find the measurement files in a folder."""

from __future__ import annotations

import csv
from pathlib import Path

from drivers.input_file import open_input
from teleop.evaluation.formats.registry import BEGINNINGS, ROS_2_BAG
from teleop.files import unreadable

TEXT_ENDINGS = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm", ".xls")
"""Endings of the names of text files that can contain a table of samples. Any text file is read if
it is named on the command line; in a folder, a file with another ending is often a script or a
configuration."""
SPREADSHEETS = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
"""Endings of the names of spreadsheets, whose first bytes are those of many other files."""
DOCUMENTS = ("readme", "license", "licence", "notice", "changelog", "requirements")
"""Names, without ending, of text files that describe a folder."""
RESULT_COLUMNS = (
    {"file", "method", "kind of k"},  # teleop compare --out
    {"source", "response", "error_degrees"},  # --anova
    {"quantity", "response", "low", "high"},  # --repeatability
    {"trial", "repetition", "estimator"},  # the table of a series
    {"point", "repetition", "estimator"},  # the table of a sweep
    {"Displacement [m]", "Excitation [-]"},  # teleop estimate --out
)
"""Columns by which the tables that this program writes are recognised."""
HEAD = 1 << 16
"""Number of bytes at the beginning of a text file in which its header is searched."""


def is_measurement(path: Path) -> bool:
    """Return whether a file in a folder is taken for a measurement, by its name and beginning.

    A ROS 2 bag is a folder. The tables with results that this program writes are no measurements.
    """
    if path.is_dir():
        return (path / ROS_2_BAG).is_file()
    if not path.is_file():
        return False
    try:
        with open_input(path) as file:
            head = file.read(HEAD)
    except OSError as error:
        raise unreadable(path, error) from error
    ending = path.suffix.lower()
    name = next((name for mark, name in BEGINNINGS.items() if head.startswith(mark)), "")
    if name == "excel":
        return ending in SPREADSHEETS
    if name:
        return True
    return (
        ending in TEXT_ENDINGS
        and path.stem.lower() not in DOCUMENTS
        and not is_result_table(head.decode("utf-8-sig", "replace"))
    )


def is_result_table(head: str) -> bool:
    """Return whether a text begins with the header of a table that this program writes."""
    try:
        header = {*next(csv.reader(head.splitlines()[:1]), ())}
    except csv.Error:
        return False
    return any(columns <= header for columns in RESULT_COLUMNS)
