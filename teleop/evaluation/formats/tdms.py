"""Read TDMS files of LabVIEW and DIAdem."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drivers.input_file import open_input
from teleop.evaluation.formats.arrays import tables_by_group, vectors
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.names import KNOWN, plain
from teleop.evaluation.formats.table import Pick, Table, missing, stated_filter

if TYPE_CHECKING:
    from estimation.arrays import Floats

MOST_WARNINGS = 3
"""Largest number of warnings of the library that are reported for a file."""
LONGEST_WARNING = 120
"""Number of characters to which a warning is shortened."""


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read a TDMS file. In each group, the channels of the same length become one table.

    If a group has no channel with a usual name of the time, the times are computed from the sample
    period of its channels (the TDMS property `wf_increment`), if it is the same for all of them.
    """
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise missing("npTDMS", "TDMS") from error
    groups: dict[str, dict[str, Floats]] = {}
    units: dict[str, dict[str, Any]] = {}
    stated = []
    with open_input(path) as file, warnings_of("nptdms") as warnings:
        content = TdmsFile.read(file)
    properties = [content.properties]
    for group in content.groups():
        properties.append(group.properties)
        columns: dict[str, Floats] = {}
        unit: dict[str, Any] = {}
        for channel in group.channels():
            properties.append(channel.properties)
            columns.update(vectors(channel.name, channel[:]))
            unit[channel.name] = channel.properties.get("unit_string")
        if not KNOWN["time"] & set(map(plain, columns)):
            increments = {
                (channel.properties.get("wf_increment"), len(channel))
                for channel in group.channels()
                if channel.name in columns
            }
            if len(increments) == 1 and next(iter(increments))[0]:
                increment, samples = increments.pop()
                columns, unit["time"] = {"time": np.arange(samples) * increment, **columns}, "s"
        groups[group.name], units[group.name] = columns, unit
    for values in properties:
        stated += [f"{key}: {value}" for key, value in values.items()]
    about = {"force_filter": found} if (found := stated_filter(stated)) else {}
    tables = tables_by_group(path, groups, pick, units, about)
    for table in tables:
        table.notes = tuple(warnings)
    return tables


@contextlib.contextmanager
def warnings_of(library: str) -> Iterator[list[str]]:
    """Context manager that collects the warnings that a library logs, so that none is printed."""
    found: list[str] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if len(found) < MOST_WARNINGS:
                found.append(f"{library}: {record.getMessage()[:LONGEST_WARNING]}")

    names = [name for name in logging.root.manager.loggerDict if name.startswith(library)]
    loggers = [logging.getLogger(name) for name in names]
    before = [(logger.handlers, logger.propagate) for logger in loggers]
    for logger in loggers:
        logger.handlers, logger.propagate = [Collector()], False
    try:
        yield found
    finally:
        for logger, (handlers, propagate) in zip(loggers, before, strict=True):
            logger.handlers, logger.propagate = handlers, propagate
