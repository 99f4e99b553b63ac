"""Separate a stream of bytes into frames by Consistent Overhead Byte Stuffing (COBS).

A frame is encoded into non-zero bytes, and ends with a zero byte. If a receiver starts in the
middle of a frame or loses bytes, it finds the start of the next frame after the next zero byte.

S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on
Networking 7(2), 1999.
"""

from __future__ import annotations

from collections import Counter

DELIMITER = b"\0"
RUN = 254
"""Largest number of non-zero bytes after one code byte."""
CODES = [bytes((length + 1,)) for length in range(RUN)]
"""Code byte of a run of non-zero bytes, by the length of the run."""


def encode(data: bytes) -> bytes:
    """Encode the data of a frame into non-zero bytes.

    The result does not contain the zero byte that ends the frame. It is one byte longer than the
    data, and can be longer by one more byte for each 254 bytes of data.
    """
    parts = []
    runs = data.split(b"\0")
    for run in runs:
        while len(run) >= RUN:
            parts.append(b"\xff" + run[:RUN])
            run = run[RUN:]
        parts.append(CODES[len(run)] + run)
    if runs[-1] and len(runs[-1]) % RUN == 0:
        parts.pop()
    return b"".join(parts)


def decode(encoded: bytes) -> bytes:
    """Return the data of an encoded frame, given without the zero byte at its end.

    The value of each code byte is the distance to the next code byte. The code bytes are replaced
    by zero bytes, with two exceptions. The first code byte is removed. Each code byte that follows
    254 non-zero bytes is also removed.
    """
    if 0 in encoded:
        raise ValueError("a zero byte in an encoded frame: expected none")
    data = bytearray(encoded)
    at, end = 0, len(data)
    fillers = []
    while at < end:
        code = data[at]
        data[at] = 0
        at += code
        if code > RUN:
            fillers.append(at)
    if at > end:
        raise ValueError(f"the last code byte is {code}: expected {code + end - at}")
    for filler in reversed(fillers):
        del data[filler : filler + 1]
    return bytes(data[1:])


class CobsReader:
    """Separates a stream of bytes into COBS frames, and decodes them."""

    def __init__(self, longest: int, rejected: Counter[str]) -> None:
        self.longest = longest
        self.rejected = rejected
        self._begun = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """Process the next bytes of the stream, and return the frames that end in these bytes.

        The frames are decoded. Empty frames are omitted. An incomplete frame at the end is stored
        for the next call.
        """
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
