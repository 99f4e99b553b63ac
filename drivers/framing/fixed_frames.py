"""Find serial frames of fixed length that start with a header and end with a checksum."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from typing import ClassVar, Generic, TypeVar

Frame = TypeVar("Frame")


class FixedFrameParser(ABC, Generic[Frame]):
    """Base class of the parsers that find frames of fixed length in a stream of bytes.

    Bytes that do not belong to a frame are skipped.
    """

    header: ClassVar[bytes]
    """Bytes with which each frame starts."""
    size: ClassVar[int]
    """Length of a frame, including its header [bytes]."""

    def __init__(self, rejected: Counter[str]) -> None:
        self.rejected = rejected
        self._rest = b""

    @abstractmethod
    def decode(self, frame: bytes) -> Frame | None:
        """Return the content of a frame, or None if the checksum of the frame is wrong."""

    def feed(self, data: bytes) -> list[Frame]:
        """Process the next bytes of the stream, and return the frames that end in these bytes.

        The oldest frame is the first. An incomplete frame at the end is stored for the next call.
        """
        frames: list[Frame] = []
        buffer, at = self._rest + data, 0
        while True:
            start = buffer.find(self.header, at)
            if start < 0:
                start = self._begun_header(buffer, at)
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

    def _begun_header(self, buffer: bytes, at: int) -> int:
        """Return the index of the first bytes of a header at the end of the buffer.

        If there are none after index `at`, return the length of the buffer.
        """
        begun = range(min(len(self.header) - 1, len(buffer) - at), 0, -1)
        return len(buffer) - next((n for n in begun if buffer.endswith(self.header[:n])), 0)
