"""Format of the data on the pipe from the control process to the recorder process.

The data start with the length of a JSON document. The JSON document follows, and describes the
session. Then frames follow: the beginning of the trial, ticks, events, and the end of the trial.
"""

from __future__ import annotations

import struct

HEAD = struct.Struct("<I")
"""Layout of the first bytes on the pipe: length of the JSON document [bytes]."""
FRAME = struct.Struct("<cH")
"""Layout of the start of a frame: kind of the frame, and length of the frame's content [bytes]."""
TICK, EVENT, BEGIN, END = b"T", b"E", b"B", b"N"
"""Kinds of frame."""
NUMBER = struct.Struct("<q")
"""Layout of the content of a frame BEGIN or END: one integer.

In a frame BEGIN, the integer is the wall-clock time of the beginning of the trial [ns]. In a frame
END, it is the number of dropped ticks.
"""


def number_frame(kind: bytes, number: int) -> bytes:
    """Return a frame of kind BEGIN or END that contains the integer `number`."""
    return FRAME.pack(kind, NUMBER.size) + NUMBER.pack(number)
