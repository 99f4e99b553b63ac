"""Define the format of the data on the pipe from the control process to the recorder process.

The data start with the length of a JSON document, and the document itself, which describes the
session. Then frames follow. A frame is a block of bytes that consists of a kind, a length and a
content. The kind states whether the content describes the beginning of the trial, a tick, an event,
or the end of the trial.
"""

from __future__ import annotations

import struct

HEAD = struct.Struct("<I")
"""Layout of the first bytes on the pipe: length of the JSON document [bytes]."""
FRAME = struct.Struct("<cH")
"""Layout of the start of a frame: kind of the frame, and length of the frame's content [bytes]."""
TICK, EVENT, BEGIN, END = b"T", b"E", b"B", b"N"
"""Kinds of frame: a tick, an event, the beginning of the trial, and the end of the trial."""
NUMBER = struct.Struct("<q")
"""Layout of the content of a frame BEGIN or END: one integer.

In a frame BEGIN, the integer is the wall-clock time of the beginning of the trial [ns]. In a frame
END, it is the number of dropped ticks.
"""


def number_frame(kind: bytes, number: int) -> bytes:
    """Return the bytes of a frame that marks the beginning or the end of a trial.

    Parameters
    ----------
    kind
        BEGIN or END.
    number
        Content of the frame: for BEGIN, the wall-clock time of the beginning of the trial [ns]; for
        END, the number of ticks that were not recorded.
    """
    return FRAME.pack(kind, NUMBER.size) + NUMBER.pack(number)
