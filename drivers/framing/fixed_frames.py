"""Frames of fixed length that start with a header and end with a checksum."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from typing import ClassVar, Generic, TypeVar

Frame = TypeVar("Frame")


class FixedFrameParser(ABC, Generic[Frame]):
    """Base class of parsers of a stream of bytes into frames, which skip bytes between frames.

    Parameters
    ----------
    rejected
        Counter: `checksum` counts frames with a wrong checksum, `noise` counts bytes between
        frames.
    """

    header: ClassVar[bytes]
    size: ClassVar[int]
    """Length of a frame, including its header [bytes]."""

    def __init__(self, rejected: Counter[str]) -> None:
        self.rejected = rejected
        self._rest = b""

    @abstractmethod
    def decode(self, frame: bytes) -> Frame | None:
        """Decode a frame; return None if the checksum is wrong."""

    def feed(self, data: bytes) -> list[Frame]:
        """Process bytes; return the frames that they complete, the oldest first."""
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
        """Return the index of the next header, of a partial header at the end, or the length."""
        found = buffer.find(self.header, at)
        if found >= 0:
            return found
        begun = range(min(len(self.header) - 1, len(buffer) - at), 0, -1)
        return len(buffer) - next((n for n in begun if buffer.endswith(self.header[:n])), 0)
