"""Frames of one length that begin with a header and end with a check sum."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from typing import ClassVar, Generic, TypeVar

Frame = TypeVar("Frame")


class FixedFrameParser(ABC, Generic[Frame]):
    """Cuts a stream of bytes into frames, and finds the next header after noise.

    Parameters
    ----------
    rejected
        Where it counts bytes that belong to no frame: `checksum` for the first byte of a header
        whose frame has a wrong check sum, `noise` for what lies between frames.
    """

    header: ClassVar[bytes]
    size: ClassVar[int]
    """Bytes of a frame, its header included."""

    def __init__(self, rejected: Counter[str]) -> None:
        self.rejected = rejected
        self._rest = b""

    @abstractmethod
    def decode(self, frame: bytes) -> Frame | None:
        """What a frame tells; None if its check sum is wrong."""

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete, the oldest first."""
        frames: list[Frame] = []
        buffer, at = self._rest + data, 0
        while True:
            start = self._header_from(buffer, at)
            if start > at:
                self.rejected["noise"] += start - at
            if len(buffer) - start < self.size:
                self._rest = buffer[start:]
                return frames
            frame = self.decode(buffer[start : start + self.size])
            if frame is None:
                self.rejected["checksum"] += 1
                at = start + 1
            else:
                frames.append(frame)
                at = start + self.size

    def _header_from(self, buffer: bytes, at: int) -> int:
        """Where the next header is, or its beginning at the end; the end where there is none."""
        found = buffer.find(self.header, at)
        if found >= 0:
            return found
        begun = range(min(len(self.header) - 1, len(buffer) - at), 0, -1)
        return len(buffer) - next((n for n in begun if buffer.endswith(self.header[:n])), 0)
