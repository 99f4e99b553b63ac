"""Chunks of MCAP files, decompressed no further than they declare."""

from __future__ import annotations

import zlib
from io import BytesIO

import lz4.frame
import zstandard
from mcap.records import Chunk

LARGEST = 64 << 20
"""Largest chunk that is taken [bytes]; the recorder's are below 1 MiB."""
PIECE = 1 << 20
"""What is decompressed at a time [bytes]."""


def chunk_data(chunk: Chunk) -> bytes:
    """The records of a chunk.

    Raises
    ------
    ValueError
        It is larger than `LARGEST` or than it declares, or cannot be decompressed, or its check
        sum does not match.
    """
    size = chunk.uncompressed_size
    if size > LARGEST:
        raise ValueError(f"a chunk of {size} bytes: expected at most {LARGEST}")
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


def plain(data: bytes, _: int) -> bytes:
    """Data that are not compressed."""
    return data


def from_zstd(data: bytes, most: int) -> bytes:
    """At most so many bytes of what data decompress to."""
    found = BytesIO()
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        while found.tell() < most:
            piece = reader.read(min(PIECE, most - found.tell()))
            if not piece:
                break
            found.write(piece)
    return found.getvalue()


def from_lz4(data: bytes, most: int) -> bytes:
    """At most so many bytes of what data decompress to."""
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most))


DECOMPRESSORS = {"": plain, "zstd": from_zstd, "lz4": from_lz4}
"""By the name of the compression; each takes the data and a largest size."""
