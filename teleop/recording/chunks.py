"""Decompress the chunks of MCAP files.

Each chunk declares the size of its decompressed data. The decompression stops one byte after this
size. A damaged chunk can therefore not fill the memory.
"""

from __future__ import annotations

import zlib
from io import BytesIO

import lz4.frame
import zstandard
from mcap.records import Chunk

LARGEST = 64 << 20
"""Size of the largest chunk that is read [bytes]. The recorder writes chunks below 1 MiB."""
PIECE = 1 << 20
"""Largest number of bytes that one call of the zstd reader decompresses."""


def chunk_data(chunk: Chunk) -> bytes:
    """Decompress a chunk, and return its records.

    Raises
    ------
    ValueError
        The chunk is larger than `LARGEST`, does not have the size that it declares, cannot be
        decompressed, or has a wrong checksum.
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


def uncompressed(data: bytes, _: int) -> bytes:
    """Return the data of an uncompressed chunk unchanged."""
    return data


def from_zstd(data: bytes, max_size: int) -> bytes:
    """Decompress zstd data to at most `max_size` bytes."""
    result = BytesIO()
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        while result.tell() < max_size:
            piece = reader.read(min(PIECE, max_size - result.tell()))
            if not piece:
                break
            result.write(piece)
    return result.getvalue()


def from_lz4(data: bytes, max_size: int) -> bytes:
    """Decompress lz4 data to at most `max_size` bytes."""
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=max_size))


DECOMPRESSORS = {"": uncompressed, "zstd": from_zstd, "lz4": from_lz4}
"""Decompression functions, by the name of the compression."""
