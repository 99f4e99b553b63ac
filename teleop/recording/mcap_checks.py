"""Checks and limits with which a damaged or hostile MCAP file cannot harm its reader."""

from __future__ import annotations

import os
import re
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.records import Chunk
from numpy.typing import NDArray

from teleop.errors import InputError
from teleop.json_documents import loads
from teleop.streams.message import CDR, tick_values

LARGEST_RECORD = 128 << 20
"""Size of the largest record that is read [bytes]."""


def machine_memory() -> int:
    """Return the memory size of this machine [bytes]; a default value if it is unknown."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 8 << 30


LARGEST_TICKS = machine_memory() // 4
"""Largest total size of ticks that are stored in memory [bytes]. The columns that are computed from
the ticks need the same amount of memory again."""


def check_memory(path: Path | str, size: int) -> None:
    """Raise an InputError if the ticks of a recording, of `size` bytes, do not fit into memory."""
    if size > LARGEST_TICKS:
        raise InputError(
            f"{path}: too large for this machine's memory: more than {LARGEST_TICKS >> 20} MiB "
            "of ticks"
        )


class BoundedFile:
    """A file from which one call of `read` returns at most `LARGEST_RECORD` bytes.

    The records of a file state their own length. That of a damaged record can be much too large,
    and a reader would request too many bytes. Bytes that are added to the file later are not read.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.left = os.fstat(file.fileno()).st_size
        """Number of bytes that have not been read yet."""

    def read(self, count: int) -> bytes:
        """Return the next `count` bytes, but at most `LARGEST_RECORD` and no more than are left."""
        data = self._file.read(min(count, self.left, LARGEST_RECORD))
        self.left -= len(data)
        return data


LARGEST_CHUNK = 64 << 20
"""Size of the largest chunk that is read, after decompression [bytes]. The chunks of the recorder
are much smaller."""
PIECE = 1 << 20
"""Largest number of bytes that one call of the zstd reader decompresses."""


def chunk_data(chunk: Chunk) -> bytes:
    """Decompress a chunk (a block of records of an MCAP file), and return the bytes of its records.

    The chunk states the size of its data. Those of a damaged chunk can be larger and fill the
    memory. Therefore the decompression stops one byte after the stated size, and an error is
    raised.
    """
    size = chunk.uncompressed_size
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes: expected at most {LARGEST_CHUNK}")
    if chunk.compression not in DECOMPRESSORS:
        raise ValueError(f"a chunk is compressed by {chunk.compression!r}: expected zstd or lz4")
    try:
        data = DECOMPRESSORS[chunk.compression](chunk.data, size + 1)
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise ValueError("a chunk cannot be decompressed") from error
    if len(data) != size:
        raise ValueError("a chunk cannot be decompressed to the size that it declares")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("the checksum of a Chunk does not match")
    return data


def uncompressed(data: bytes, _: int) -> bytes:
    """Return data that are not compressed."""
    return data


def from_zstd(data: bytes, max_size: int) -> bytes:
    """Return at most the first `max_size` bytes of zstd data."""
    result = BytesIO()
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        while result.tell() < max_size:
            piece = reader.read(min(PIECE, max_size - result.tell()))
            if not piece:
                break
            result.write(piece)
    return result.getvalue()


def from_lz4(data: bytes, max_size: int) -> bytes:
    """Return at most the first `max_size` bytes of lz4 data."""
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=max_size))


DECOMPRESSORS = {"": uncompressed, "zstd": from_zstd, "lz4": from_lz4}
"""Decompression functions, by the name of the compression."""


MOST_COLUMNS = 4096
"""Largest number of columns in a recording."""
LONGEST_NAME = 63
"""Largest number of characters in the name of a column. Variable names in MATLAB have the same
limit."""
LATEST = 1e7
"""Largest magnitude of the time of a tick or an event, from the beginning of the trial [s]."""
COLUMN = re.compile(r"float64 ([A-Za-z]\w*)(?:\s*#[^\n]*)?", re.ASCII)
"""Pattern of the line for one column in the definition of a tick's message."""
LARGEST_NUMBER = 10**300
"""Largest magnitude of a numerical value in an event."""
NUMBER = float | int | None
EVENT = {
    "text": str,
    "mode": str,
    "source": str,
    "fault": str | None,
    "value": NUMBER,
    "limit": NUMBER,
    "since": NUMBER,
}
"""Expected type of each item of an event, by the name of the item.

If the item `fault` of an event is empty, the items `source`, `value`, `limit` and `since` may be
missing.
"""


def message_size(definition: str) -> int:
    """Return the size of the message of a tick [bytes], from its definition.

    All fields must be doubles with different names, and the first name must be `time`. Otherwise a
    ValueError is raised.
    """
    if "\0" in definition:
        raise ValueError("the definition of its ticks is not text")
    lines = [line for line in definition.split("\n") if line and not line.startswith("#")]
    matches = [COLUMN.fullmatch(line) for line in lines]
    names = [match[1] for match in matches if match]
    if len(names) < len(lines) or definition.count("float64 ") > len(lines):
        raise ValueError("the definition of its ticks contains other types than doubles")
    if not names or names[0] != "time" or len(set(names)) < len(names):
        raise ValueError("the definition of its ticks: expected distinct names, 'time' first")
    if len(names) > MOST_COLUMNS or max(map(len, names)) > LONGEST_NAME:
        raise ValueError("the definition of its ticks has too many names or too long ones")
    return len(CDR) + 8 * len(names)


def check_ticks(ticks: NDArray[np.uint8], sequence: NDArray[np.uint32]) -> None:
    """Check sequence numbers, encoding and times of the messages of successive ticks."""
    if (np.diff(sequence.astype(np.int64)) != 1).any():
        raise ValueError("the numbers of its ticks do not increase by one")
    if (ticks[:, : len(CDR)] != np.frombuffer(CDR, np.uint8)).any():
        raise ValueError("a tick is not in little-endian CDR")
    time = tick_values(ticks, slice(1))
    if not (np.abs(time) < LATEST).all():
        raise ValueError("a tick has no valid time")


def read_event(document: bytes) -> dict[str, Any]:
    """Return an event of a recording from its JSON document."""
    event = loads(document)
    check_event(event)
    return event


def check_event(event: Any) -> None:
    """Raise a ValueError if a value is not an event: `EVENT` states the types of its items."""
    if not isinstance(event, dict):
        raise ValueError("an event is not an object")
    time = event.get("time")
    if isinstance(time, bool) or not isinstance(time, int | float) or not abs(time) < LATEST:
        raise ValueError("an event has no valid time")
    needed = EVENT if event.get("fault") else ("text", "mode", "fault")
    for name, kind in EVENT.items():
        if name not in event and name in needed:
            raise ValueError(f"an event has no {name}")
        if not isinstance(event.get(name), kind) and name in event:
            raise ValueError(f"an event has a {name} of an unexpected type")
        if kind == NUMBER and abs(event.get(name) or 0) > LARGEST_NUMBER:
            raise ValueError(f"an event has a {name} that is too large")


def is_valid_metadata(metadata: dict[str, str]) -> bool:
    """Return whether a record has no zero byte, and its text `json`, if any, is a JSON object."""
    try:
        loads(metadata.get("json", "{}"))
    except ValueError:
        return False
    return not any("\0" in text for pair in metadata.items() for text in pair)
