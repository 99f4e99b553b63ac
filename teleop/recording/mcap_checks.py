"""What must hold of a recording's parts before they are used: a file may come from anywhere."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from teleop.json_documents import loads
from teleop.recording.message import CDR

MOST_COLUMNS = 4096
LONGEST_NAME = 63
"""Most characters in the name of a column, what MATLAB takes."""
LATEST = 1e7
"""Farthest time of a tick or an event from the beginning of its trial [s]."""
COLUMN = re.compile(r"float64 ([A-Za-z]\w*)(?:\s*#[^\n]*)?", re.ASCII)
LARGEST_NUMBER = 10**300
NUMBER = float | int | None
EVENT = {
    "text": str,
    "mode": str,
    "source": str,
    "fault": str | None,
    "value": NUMBER,
    "limit": NUMBER,
    "since": NUMBER,
}
"""Types of an event's parts; those that tell of a fault may be missing where there is none."""


def message_size(definition: str) -> int:
    """Size of a tick's message [bytes].

    Raises
    ------
    ValueError
        It is not the definition of a tick: doubles with distinct names, the time first.
    """
    if "\0" in definition:
        raise ValueError("the definition of its ticks is not text")
    lines = [line for line in definition.split("\n") if line and not line.startswith("#")]
    matches = [COLUMN.fullmatch(line) for line in lines]
    names = [match[1] for match in matches if match]
    if len(names) < len(lines) or definition.count("float64 ") > len(lines):
        raise ValueError("the definition of its ticks has more than doubles")
    if not names or names[0] != "time" or len(set(names)) < len(names):
        raise ValueError("the definition of its ticks: expected distinct names, the first time")
    if len(names) > MOST_COLUMNS or max(map(len, names)) > LONGEST_NAME:
        raise ValueError("the definition of its ticks has too many or too long names")
    return len(CDR) + 8 * len(names)


def check_ticks(ticks: NDArray[np.uint8], sequence: NDArray[np.uint32]) -> None:
    """Raise ValueError unless messages, a row each, are ticks of rising numbers."""
    if (np.diff(sequence.astype(np.int64)) != 1).any():
        raise ValueError("the numbers of its ticks do not rise by one")
    if (ticks[:, : len(CDR)] != np.frombuffer(CDR, np.uint8)).any():
        raise ValueError("a tick that is not in little-endian CDR")
    times = np.ascontiguousarray(ticks[:, len(CDR) : len(CDR) + 8]).view("<f8")
    if not (np.abs(times) < LATEST).all():
        raise ValueError("a tick without a time")


def checked_event(document: bytes) -> dict[str, Any]:
    """An event from its JSON document.

    Raises
    ------
    ValueError
        It is not as expected.
    """
    event = loads(document)
    time = event.get("time")
    if isinstance(time, bool) or not isinstance(time, int | float) or not abs(time) < LATEST:
        raise ValueError("an event without a time")
    needed = EVENT if event.get("fault") else ("text", "mode", "fault")
    for name, kind in EVENT.items():
        if name not in event and name in needed:
            raise ValueError(f"an event without its {name}")
        if not isinstance(event.get(name), kind) and name in event:
            raise ValueError(f"an event whose {name} is not as expected")
        if kind == NUMBER and abs(event.get(name) or 0) > LARGEST_NUMBER:
            raise ValueError(f"an event whose {name} is too large")
    return event


def is_readable(metadata: dict[str, str]) -> bool:
    """Whether a record of metadata is text, and its JSON, if any, whole."""
    try:
        loads(metadata.get("json", "{}"))
    except ValueError:
        return False
    return not any("\0" in text for pair in metadata.items() for text in pair)
