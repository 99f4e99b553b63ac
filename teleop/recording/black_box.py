"""Write the black box: the ticks shortly before and after a fault."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from estimation.estimate_columns import Column
from teleop.files import unwritable
from teleop.recording.mcap_writer import McapFile
from teleop.recording.recording import Recording
from teleop.streams.message import definition_of, messages_of

BEFORE, AFTER = 5.0, 1.0
"""Duration of the stored part of a trial before a fault, and after the fault [s]."""


def write_black_box(
    path: Path,
    columns: tuple[Column, ...],
    kept: Recording,
    metadata: Mapping[str, Mapping[str, str]],
    start: int,
) -> None:
    """Write the kept ticks and events to a file; `start` is the wall-clock time of t = 0 [ns]."""
    messages = messages_of(np.column_stack([kept[column.name] for column in columns]))
    try:
        file = McapFile(path, columns, definition_of(columns), metadata, overwrite=True)
        file.begin(start)
        for message, t in zip(messages, kept["time"].tolist(), strict=True):
            file.tick(message, t)
        for event in kept.events:
            file.event(event)
        file.close()
    except OSError as error:
        raise unwritable(path, error) from error
    if file.error:
        raise unwritable(path, file.error)
