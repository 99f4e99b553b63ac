"""Frames on the pipe from the control process to the recorder process.

The pipe carries the length of a JSON document, this document, which describes the session, and
then frames: the beginning of the trial, ticks, events, and the end of the trial.
"""

from __future__ import annotations

import struct

HEAD = struct.Struct("<I")
"""Length of the JSON document of the session."""
FRAME = struct.Struct("<cH")
"""Kind of a frame and length of its content."""
TICK, EVENT, BEGIN, END = b"T", b"E", b"B", b"N"
"""Kinds of frame."""
NUMBER = struct.Struct("<q")
"""Wall-clock time of the beginning of the trial [ns], or number of dropped ticks at its end."""


def number_frame(kind: bytes, number: int) -> bytes:
    """Return a frame that carries one number."""
    return FRAME.pack(kind, NUMBER.size) + NUMBER.pack(number)
