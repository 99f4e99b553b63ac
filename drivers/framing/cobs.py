"""Frames on a stream of bytes by Consistent Overhead Byte Stuffing.

A frame is encoded into bytes without a zero, and a zero ends it; so a receiver that comes late, or
that lost bytes, is in step again at the next zero.

S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on
Networking 7(2), 1999.
"""

from __future__ import annotations

from collections import Counter

DELIMITER = b"\0"
RUN = 254
"""Longest run of bytes without a zero behind one code byte."""


def encode(data: bytes) -> bytes:
    """The bytes without a zero among them, longer by one and by one more for 254; no delimiter."""
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
    """What was encoded: each code byte stands for a zero, but the first and those behind full runs.

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
    """Takes frames out of a stream.

    Parameters
    ----------
    longest
        Most bytes of an encoded frame; what is longer is no frame of this protocol.
    rejected
        Where frames that are not taken are counted, as `length` or `framing`.
    """

    def __init__(self, longest: int, rejected: Counter[str]) -> None:
        self.longest = longest
        self.rejected = rejected
        self._begun = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """The frames that are complete with these bytes, decoded; empty ones are fillers."""
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
