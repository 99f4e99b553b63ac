"""Decompress the chunks of MCAP files. A damaged chunk cannot fill the memory.

A chunk is a block of records, usually compressed. It states the size of its data after
decompression. If a chunk is damaged, its data can be larger. The decompression therefore stops one
byte after the stated size, and an error is raised.
"""

from __future__ import annotations

import zlib
from io import BytesIO

import lz4.frame
import zstandard
from mcap.records import Chunk

LARGEST = 64 << 20
"""Size of the largest chunk that is read, after decompression [bytes]. The chunks of the recorder
are much smaller."""
PIECE = 1 << 20
"""Largest number of bytes that one call of the zstd reader decompresses."""


def chunk_data(chunk: Chunk) -> bytes:
    """Decompress a chunk (a block of records of an MCAP file), and return the bytes of its records.

    Raises
    ------
    ValueError
        The chunk states a size larger than `LARGEST`, or its data do not have the stated size. The
        data cannot be decompressed, or have a wrong checksum.
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
    """Return the data of a chunk that is not compressed. The second argument is not used.

    The function has the same parameters as the functions that decompress data.
    """
    return data


def from_zstd(data: bytes, max_size: int) -> bytes:
    """Decompress zstd data. Return at most the first `max_size` bytes of the result."""
    result = BytesIO()
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        while result.tell() < max_size:
            piece = reader.read(min(PIECE, max_size - result.tell()))
            if not piece:
                break
            result.write(piece)
    return result.getvalue()


def from_lz4(data: bytes, max_size: int) -> bytes:
    """Decompress lz4 data. Return at most the first `max_size` bytes of the result."""
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=max_size))


DECOMPRESSORS = {"": uncompressed, "zstd": from_zstd, "lz4": from_lz4}
"""Decompression functions, by the name of the compression."""
