"""Read the intact (undamaged) part of a recording, an MCAP file that `teleop run` has written."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import CRCValidationError, StreamReader
from numpy.typing import NDArray

from drivers.input_file import open_input
from teleop.errors import InputError
from teleop.files import unreadable
from teleop.recording.mcap_checks import (
    LARGEST_RECORD,
    BoundedFile,
    check_memory,
    check_ticks,
    chunk_data,
    is_valid_metadata,
    message_size,
    read_event,
)
from teleop.recording.mcap_writer import EVENT_SCHEMA, EVENTS, TICKS
from teleop.recording.schema import check_schema
from teleop.streams.message import MESSAGE_NAME, TIME

MAGIC = b"\x89MCAP"
"""First bytes of an MCAP file."""
HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("logged", "<u8"),
        ("published", "<u8"),
    ]
)
"""Layout of the start of a message record of an MCAP file."""
MOST_EVENTS = 100_000
"""Largest number of events that are read."""
LATEST_START = 1 << 62
"""Latest accepted wall-clock time of the beginning of a trial, since 1970 [ns]."""
CUT = "its end is missing"
"""Damage of a file whose end is missing: its writer was killed, or the disk was full."""


@dataclass
class Source:
    """A channel (numbered series of messages) of an MCAP file that is being read.

    If a message does not have the expected sequence number, a part of the file is missing.
    """

    topic: str
    """Topic (name) of the channel."""
    following: int | None = None
    """Expected sequence number of the next message; None before the first message."""

    def follow(self, sequence: int, count: int) -> None:
        """Raise a ValueError if the next `count` messages, from `sequence` on, do not follow."""
        if self.following not in (None, sequence):
            raise ValueError(f"messages of {self.topic} are missing before number {sequence}")
        self.following = sequence + count


@dataclass
class Contents:
    """Intact (undamaged) content of a recording: ticks, events and metadata."""

    definition: str = ""
    """Definition of the message of a tick, in the message definition language of ROS 2."""
    messages: bytearray = field(default_factory=bytearray)
    """Messages of all ticks as bytes, one after another."""
    events: list[dict[str, Any]] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    start: int = 0
    """Wall-clock time of the beginning of the trial [ns]."""
    damage: str = ""
    """Reason why the file is not complete; empty if the file is complete."""
    size: int = 0
    """Size of the message of one tick [bytes]."""


def read_intact(path: Path) -> Contents:
    """Read the intact part of a recording into memory."""
    contents = Contents()
    for rows in read_ticks(path, contents):
        contents.messages += rows.tobytes()
        check_memory(path, len(contents.messages))
    return contents


def read_ticks(path: Path, contents: Contents) -> Iterator[NDArray[np.uint8]]:
    """Yield messages of successive ticks as bytes, shape (n, bytes per message), while intact.

    The other data are stored in `contents`. When the first ticks are yielded, it already has the
    definition, and the metadata at the beginning of the file. `contents.messages` remains empty.
    """
    try:
        with open_input(path) as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise InputError(f"{path}: not an MCAP file")
            file.seek(0)
            yield from read_records(file, contents)
    except OSError as error:
        raise unreadable(path, error) from error
    if not contents.definition:
        raise InputError(
            f"{path}: contains no ticks: expected a recording of teleop run"
            + (f" ({contents.damage})" if contents.damage else "")
        )


class ReaderWithoutIndices(StreamReader):
    """MCAP reader that skips message indices, because they take longer to parse than the ticks."""

    def _read_record(self, opcode: int, length: int) -> McapRecord | None:
        if opcode == Opcode.MESSAGE_INDEX:
            self._stream.read(length)
            return None
        return super()._read_record(opcode, length)


def read_records(file: BinaryIO, contents: Contents) -> Iterator[NDArray[np.uint8]]:
    """Yield the messages of ticks, shape (n, bytes per message), up to the first damaged record.

    The other data, and a text about the damage, are stored in `contents`.
    """
    channels: dict[int, Source] = {}
    bounded = BoundedFile(file)
    reader = ReaderWithoutIndices(
        cast(BinaryIO, bounded),
        emit_chunks=True,
        validate_crcs=True,
        record_size_limit=min(LARGEST_RECORD, bounded.left),
    )
    damage = ""
    try:
        for record in reader.records:
            if isinstance(record, Chunk):
                yield from read_chunk(record, contents, channels)
                if len(contents.events) > MOST_EVENTS:
                    raise InputError(f"{file.name}: more than {MOST_EVENTS} events")
            elif isinstance(record, Metadata) and record.name in contents.metadata:
                contents.damage = f"damaged: it contains its {record.name} twice"
            elif isinstance(record, Metadata) and is_valid_metadata(record.metadata):
                contents.metadata[record.name] = dict(record.metadata)
                if record.name == "session":
                    check_schema(Path(file.name), record.metadata)
            elif isinstance(record, Metadata):
                contents.damage = f"damaged: its {record.name} cannot be read"
    except CRCValidationError as error:
        damage = f"damaged: the checksum of a {type(error.record).__name__} does not match"
    except RecordLengthLimitExceeded:
        too_large = bounded.left > LARGEST_RECORD
        damage = (
            f"damaged: a record is larger than {LARGEST_RECORD >> 20} MiB" if too_large else CUT
        )
    except (McapError, struct.error, ValueError, OverflowError, MemoryError) as error:
        why = " ".join(str(error).split()) or "a record cannot be read"
        damage = f"damaged: {why}" if file.read(1) else CUT
    contents.damage = contents.damage or damage


def read_chunk(
    chunk: Chunk, contents: Contents, channels: dict[int, Source]
) -> Iterator[NDArray[np.uint8]]:
    """Yield the messages of ticks in a chunk; store its events and its channels by number."""
    for record in records(chunk_data(chunk), contents, channels):
        if isinstance(record, np.ndarray):
            yield record
        elif isinstance(record, Schema) and record.name == MESSAGE_NAME:
            definition = record.data.decode()
            if contents.definition not in ("", definition):
                raise ValueError("its ticks have two definitions")
            contents.size = message_size(definition)
            contents.definition = definition
        elif isinstance(record, Channel):
            channels.setdefault(record.id, Source(record.topic))
        elif isinstance(record, Message) and channels[record.channel_id].topic == EVENTS:
            event = read_event(record.data)
            shown = EVENT_SCHEMA["properties"]
            contents.events.append({k: v for k, v in event.items() if k not in shown})
            contents.start = start_time(record.log_time, event["time"])


def records(
    data: bytes, contents: Contents, channels: dict[int, Source]
) -> Iterator[Schema | Channel | Message | NDArray[np.uint8]]:
    """Yield the records of a decompressed chunk.

    Messages of successive ticks are one array of bytes, shape (n, bytes per message).
    """
    place = 0
    while place < len(data):
        whole = len(data) - place >= 9
        opcode, length = struct.unpack_from("<BQ", data, place) if whole else (0, len(data))
        if place + 9 + length > len(data):
            raise ValueError("a record is longer than its chunk")
        if opcode == Opcode.MESSAGE:
            _, _, channel, sequence, logged, published = np.frombuffer(data, HEAD, 1, place)[
                0
            ].item()
            source = channels.get(channel)
            if source is None:
                raise ValueError("a message has no channel")
            if source.topic == TICKS:
                if not contents.size or HEAD.itemsize + contents.size != 9 + length:
                    raise ValueError("the size of a tick does not match its definition")
                run = consecutive_records(data, place, contents.size)
                source.follow(sequence, len(run))
                check_ticks(run["message"], run["sequence"])
                if not contents.start:
                    contents.start = start_time(logged, TIME.unpack_from(run["message"][0])[0])
                yield run["message"]
                place += run.nbytes
                continue
            source.follow(sequence, 1)
            body = data[place + HEAD.itemsize : place + 9 + length]
            yield Message(channel, logged, body, published, sequence)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            stream = ReadDataStream(BytesIO(data[place + 9 : place + 9 + length]))
            yield Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)
        place += 9 + length


def consecutive_records(data: bytes, place: int, size: int) -> NDArray[np.void]:
    """Return the record at byte `place`, and those of the same kind that directly follow it.

    They have the same opcode, size and channel, and the fields of `HEAD` and `message`, which has
    `size` bytes.
    """
    kind = np.dtype([*HEAD.descr, ("message", "u1", (size,))])
    rows = np.frombuffer(data, kind, (len(data) - place) // kind.itemsize, place)
    same = np.ones(len(rows), bool)
    for name in ("opcode", "length", "channel"):
        same &= rows[name] == rows[name][0]
    return rows if same.all() else rows[: int(np.argmin(same))]


def start_time(logged: int, t: float) -> int:
    """Return the wall-clock time of t = 0 [ns]; a message at t [s] was logged at `logged`."""
    start = logged - round(t * 1e9)
    if not 0 <= start < LATEST_START:
        raise ValueError("a message has no valid wall-clock time")
    return start
