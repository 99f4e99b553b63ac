"""Framing of a stream of bytes by Consistent Overhead Byte Stuffing (COBS).

A frame is encoded into non-zero bytes and ends with a zero. So a receiver that starts late or
loses bytes is synchronised again at the next zero.

S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on
Networking 7(2), 1999.
"""

from __future__ import annotations

from collections import Counter

DELIMITER = b"\0"
RUN = 254
"""Largest number of non-zero bytes after one code byte."""


def encode(data: bytes) -> bytes:
    """Encode data into non-zero bytes, without delimiter.

    The result is longer by one byte, and by one more for each 254 bytes.
    """
    parts = []
    runs = data.split(b"\0")
    for run in runs:
        while len(run) >= RUN:
            parts.append(b"\xff" + run[:RUN])
            run = run[RUN:]
        parts.append(bytes((len(run) + 1,)) + run)
    if runs[-1] and len(runs[-1]) % RUN == 0:
        parts.pop()
    return b"".join(parts)


def decode(encoded: bytes) -> bytes:
    """Decode the bytes of a frame.

    Each code byte is replaced by a zero, except the first one and those after a run of 254.

    Raises
    ------
    ValueError
        A code byte is zero or points beyond the end.
    """
    data = bytearray(encoded)
    at, end = 0, len(data)
    fillers = []
    while at < end:
        code = data[at]
        if not code or code > end - at:
            raise ValueError(f"code {code} at byte {at} of {end}: expected 1 to {end - at}")
        data[at] = 0
        at += code
        if code > RUN and at < end:
            fillers.append(at)
    for filler in reversed(fillers):
        del data[filler]
    return bytes(data[1:])


class CobsReader:
    """Decoder of the frames in a stream of bytes.

    Parameters
    ----------
    longest
        Largest length of an encoded frame [bytes]. Longer frames are rejected.
    rejected
        Counter of rejected frames, by the reason `length` or `framing`.
    """

    def __init__(self, longest: int, rejected: Counter[str]) -> None:
        self.longest = longest
        self.rejected = rejected
        self._begun = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """Process bytes; return the decoded frames that they complete, without empty ones."""
        *ended, begun = (self._begun + data).split(DELIMITER)
        frames = []
        for encoded in ended:
            if self._skipping:
                self._skipping = False
            elif len(encoded) > self.longest:
                self.rejected["length"] += 1
            elif encoded:
                try:
                    frames.append(decode(encoded))
                except ValueError:
                    self.rejected["framing"] += 1
        if len(begun) > self.longest:
            self.rejected["length"] += not self._skipping
            self._skipping = True
        self._begun = b"" if self._skipping else begun
        return frames
