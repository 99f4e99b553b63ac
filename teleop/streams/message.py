"""The bytes of the message of a tick: a ROS 2 message of doubles in CDR encoding.

PlotJuggler, Lichtblick and Foxglove show such messages without a plug-in. numpy converts the
messages of many ticks to an array in one step.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats

CDR = b"\0\1\0\0"
"""First bytes of a little-endian message in CDR (Common Data Representation)."""
TIME = struct.Struct("<4xd")
"""Layout of the start of a message: the bytes of the constant `CDR`, then the time [s]."""
MESSAGE_NAME = "teleop/msg/Tick"
BEGIN = "recording"
"""Text of the event that marks the beginning of a recording."""
FIELD = re.compile(r"float64 (\w+)(?:\s*#\s*\[([^]]*)\]\s*(.*))?")
"""Pattern of a line of the definition: name, unit and meaning of one column."""


def definition_of(columns: Iterable[Sequence[str]]) -> str:
    """Return the definition of a message in the message definition language of ROS 2."""
    lines = (f"float64 {name}  # [{unit}] {meaning}" for name, unit, meaning in columns)
    return "\n".join(["# One tick of the control loop", *lines]) + "\n"


def messages_of(rows: Floats) -> list[bytes]:
    """Convert rows of numbers, shape (ticks, columns), to the messages of the ticks."""
    size = len(CDR) + 8 * rows.shape[1]
    data = np.empty((len(rows), size), np.uint8)
    data[:, : len(CDR)] = np.frombuffer(CDR, np.uint8)
    data[:, len(CDR) :] = np.ascontiguousarray(rows, "<f8").view(np.uint8)
    joined = data.tobytes()
    return [joined[start : start + size] for start in range(0, len(joined), size)]


def tick_values(rows: NDArray[np.uint8], columns: Sequence[int] | slice = slice(None)) -> Floats:
    """Convert messages, shape (ticks, bytes per message), to numbers, shape (columns, ticks).

    `columns` contains the indices of the wanted columns.
    """
    return rows[:, len(CDR) :].view("<f8")[:, columns].T.copy()
