"""TDMS files of LabVIEW and DIAdem."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from drivers.input_file import open_input
from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.evaluation.formats.arrays import tables_by_group, vectors
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.names import NAMES, plain
from teleop.evaluation.formats.table import Pick, Table, missing, stated_filter

TIMES = {plain(name) for name in NAMES["time"]}


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """The tables in a TDMS file: the channels of one length in each group.

    A group without a channel of time has the time of its waveforms, where they state an increment.
    """
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise missing("npTDMS", "TDMS") from error
    groups: dict[str, dict[str, Floats]] = {}
    units: dict[str, dict[str, Any]] = {}
    stated = []
    with open_input(path) as file:
        try:
            content = TdmsFile.read(file)
        except OSError:
            raise
        except Exception as error:  # npTDMS raises errors of any kind for damaged content
            raise InputError(f"{path}: cannot be read as TDMS: {error}") from error
    properties = [content.properties]
    for group in content.groups():
        properties.append(group.properties)
        columns: dict[str, Floats] = {}
        unit: dict[str, Any] = {}
        for channel in group.channels():
            properties.append(channel.properties)
            columns.update(vectors(channel.name, channel[:]))
            unit[channel.name] = channel.properties.get("unit_string")
        if not TIMES & set(map(plain, columns)):
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
    return tables_by_group(path, groups, pick, units, about)
