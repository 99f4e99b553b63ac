"""Frames on the pipe from the control process to the recorder process.

The pipe carries the length of a JSON document, this document, which describes the session, and
then frames: the beginning of the trial, ticks, events, and the end of the trial.
"""

from __future__ import annotations

import struct

HEAD = struct.Struct("<I")
"""Struct with the length of the JSON document of the session [bytes]."""
FRAME = struct.Struct("<cH")
"""Struct with the kind of a frame and the length of its content [bytes]."""
TICK, EVENT, BEGIN, END = b"T", b"E", b"B", b"N"
"""Kinds of frame."""
NUMBER = struct.Struct("<q")
"""Struct with the content of a frame BEGIN or END.

For BEGIN it is the wall-clock time of the beginning of the trial [ns], for END the number of
dropped ticks.
"""


def number_frame(kind: bytes, number: int) -> bytes:
    """Return a frame that carries one number."""
    return FRAME.pack(kind, NUMBER.size) + NUMBER.pack(number)
