"""Read ROS bags (recorded messages of robots): a file of ROS 1, or a folder of ROS 2."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.messages import Message, tables_of
from teleop.evaluation.formats.table import Pick, Table, missing


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """Read the messages of a ROS bag as a table, in which each number of a message is a column."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise missing("rosbags", "a ROS bag") from error
    store = get_typestore(Stores.LATEST)
    reader = AnyReader([path], default_typestore=store)
    reader.open()

    def messages(topics: Sequence[str]) -> Iterator[Message]:
        connections = [c for c in reader.connections if c.topic in topics]
        for connection, recorded, data in reader.messages(connections):
            yield connection.topic, recorded, partial(reader.deserialize, data, connection.msgtype)

    with contextlib.closing(reader):
        topics = {connection.topic: None for connection in reader.connections}
        return tables_of(path, list(topics), messages, pick, wanted)
