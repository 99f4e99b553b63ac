"""Read MCAP files that teleop did not record, with messages of ROS 2 or in JSON."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Schema
from mcap.summary import Summary

from drivers.input_file import open_input
from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.messages import Message, tables_of
from teleop.evaluation.formats.table import Pick, Table, missing, reading
from teleop.streams.message import MESSAGE_NAME

LARGEST_RECORD = 128 << 20
"""Size of the largest record that is read [bytes]."""
FAULTS = (McapError, struct.error, ValueError, OverflowError, MemoryError, KeyError, EOFError)
"""Exceptions that the libraries raise for a damaged file."""


def is_foreign(path: Path) -> bool:
    """Return whether a file is a complete MCAP file that teleop did not record."""
    try:
        with open_input(path) as file:
            summary = summary_of(file)
    except (OSError, *FAULTS):
        return False
    return summary is not None and MESSAGE_NAME not in {s.name for s in summary.schemas.values()}


def summary_of(file: BinaryIO) -> Summary | None:
    """Return the summary at the end of an MCAP file; None if the file has no summary."""
    return SeekingReader(file, record_size_limit=LARGEST_RECORD).get_summary()


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read an MCAP file as a table. Each number in a message is a column (see `tables_of`)."""
    with open_input(path) as file:
        summary = summary_of(file)
        if summary is None:
            raise InputError(f"{path}: the MCAP file has no summary: expected a complete file")
        channels = summary.channels
        decoders = {
            i: decoder_of(path, c, summary.schemas.get(c.schema_id)) for i, c in channels.items()
        }
        topics = {c.topic: None for i, c in channels.items() if decoders[i]}

        def messages(names: Sequence[str]) -> Iterator[Message]:
            file.seek(0)
            reader = SeekingReader(file, record_size_limit=LARGEST_RECORD)
            for _, channel, message in reader.iter_messages(names):
                if decode := decoders.get(channel.id):
                    yield channel.topic, message.log_time, partial(decode, message.data)

        tables = tables_of(path, list(topics), messages, pick, wanted)
    if not tables:
        found = ", ".join(f"{c.topic} ({c.message_encoding})" for c in channels.values())
        raise InputError(
            f"{path}: no numbers in messages of ROS 2 or JSON: found {found or 'none'}"
        )
    return tables


def decoder_of(
    path: Path, channel: Channel, schema: Schema | None
) -> Callable[[bytes], Any] | None:
    """Return the function that decodes the messages of a channel of an MCAP file.

    `schema`: None if the file contains no definition.

    The result is None if the messages are neither JSON nor ROS 2 messages.
    """
    if channel.message_encoding == "json":
        return json.loads
    if channel.message_encoding != "cdr":
        return None
    try:
        from mcap_ros2.decoder import DecoderFactory
    except ImportError as error:
        raise missing("mcap-ros2-support", "MCAP with messages of ROS 2") from error
    with reading(path, f"messages of {channel.topic}"):
        decoder: Callable[[bytes], Any] | None = DecoderFactory().decoder_for("cdr", schema)
    return decoder
