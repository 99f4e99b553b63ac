"""Check the content of a recording (an MCAP file), which may be damaged."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from teleop.json_documents import loads
from teleop.recording.cdr import CDR

MOST_COLUMNS = 4096
"""Largest number of columns in a recording."""
LONGEST_NAME = 63
"""Largest number of characters in the name of a column. Variable names in MATLAB have the same
limit."""
LATEST = 1e7
"""Largest magnitude of the time of a tick or an event, from the beginning of the trial [s]."""
COLUMN = re.compile(r"float64 ([A-Za-z]\w*)(?:\s*#[^\n]*)?", re.ASCII)
"""Pattern of the line for one column in the definition of a tick's message."""
LARGEST_NUMBER = 10**300
"""Largest magnitude of a numerical value in an event."""
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
"""Expected type of each item of an event, by the name of the item.

If the item `fault` of an event is empty, the items `source`, `value`, `limit` and `since` may be
missing.
"""


def message_size(definition: str) -> int:
    """Return the size of the message of one tick [bytes], computed from the message definition.

    Parameters
    ----------
    definition
        Definition of the message in the message definition language of ROS 2.

    Raises
    ------
    ValueError
        The definition is not that of a tick. All fields must be doubles with different names, and
        the first name must be `time`. `MOST_COLUMNS` and `LONGEST_NAME` limit the names.
    """
    if "\0" in definition:
        raise ValueError("the definition of its ticks is not text")
    lines = [line for line in definition.split("\n") if line and not line.startswith("#")]
    matches = [COLUMN.fullmatch(line) for line in lines]
    names = [match[1] for match in matches if match]
    if len(names) < len(lines) or definition.count("float64 ") > len(lines):
        raise ValueError("the definition of its ticks contains other types than doubles")
    if not names or names[0] != "time" or len(set(names)) < len(names):
        raise ValueError("the definition of its ticks: expected distinct names, 'time' first")
    if len(names) > MOST_COLUMNS or max(map(len, names)) > LONGEST_NAME:
        raise ValueError("the definition of its ticks has too many names or too long ones")
    return len(CDR) + 8 * len(names)


def check_ticks(ticks: NDArray[np.uint8], sequence: NDArray[np.uint32]) -> None:
    """Check the messages of n successive ticks.

    Parameters
    ----------
    ticks
        Bytes of the messages, shape (n, bytes per message).
    sequence
        Sequence number of each message, shape (n, 1).

    Raises
    ------
    ValueError
        A message is not in little-endian CDR (Common Data Representation), or its time is not a
        number or exceeds `LATEST`. Or the sequence numbers do not increase by one.
    """
    if (np.diff(sequence.astype(np.int64)) != 1).any():
        raise ValueError("the numbers of its ticks do not increase by one")
    if (ticks[:, : len(CDR)] != np.frombuffer(CDR, np.uint8)).any():
        raise ValueError("a tick is not in little-endian CDR")
    times = np.ascontiguousarray(ticks[:, len(CDR) : len(CDR) + 8]).view("<f8")
    if not (np.abs(times) < LATEST).all():
        raise ValueError("a tick has no valid time")


def read_event(document: bytes) -> dict[str, Any]:
    """Return an event of a recording from its JSON document, as a dictionary.

    Raises
    ------
    ValueError
        The document is not a JSON object, or the event is not valid.
    """
    event = loads(document)
    check_event(event)
    return event


def check_event(event: Any) -> None:
    """Check that a value is an event of a recording.

    Raises
    ------
    ValueError
        The value is not a dictionary. Or an item of the event is missing, is too large, or has a
        wrong type. `EVENT` contains the expected types.
    """
    if not isinstance(event, dict):
        raise ValueError("an event is not an object")
    time = event.get("time")
    if isinstance(time, bool) or not isinstance(time, int | float) or not abs(time) < LATEST:
        raise ValueError("an event has no valid time")
    needed = EVENT if event.get("fault") else ("text", "mode", "fault")
    for name, kind in EVENT.items():
        if name not in event and name in needed:
            raise ValueError(f"an event has no {name}")
        if not isinstance(event.get(name), kind) and name in event:
            raise ValueError(f"an event has a {name} of an unexpected type")
        if kind == NUMBER and abs(event.get(name) or 0) > LARGEST_NUMBER:
            raise ValueError(f"an event has a {name} that is too large")


def is_valid_metadata(metadata: dict[str, str]) -> bool:
    """Return whether a metadata record of an MCAP file is valid.

    A metadata record is a dictionary of texts. No key and no text may contain a zero byte. If there
    is a key `json`, its text must be a JSON object.
    """
    try:
        loads(metadata.get("json", "{}"))
    except ValueError:
        return False
    return not any("\0" in text for pair in metadata.items() for text in pair)
