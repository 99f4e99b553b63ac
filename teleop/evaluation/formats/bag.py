"""Bags of ROS 1 and ROS 2."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.messages import Message, tables_of
from teleop.evaluation.formats.table import Pick, Table, missing


def read(path: Path, pick: Pick, wanted: Wanted) -> list[Table]:
    """The table of the messages in a bag: a file of ROS 1, or a folder of ROS 2."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise missing("rosbags", "a ROS bag") from error
    store = get_typestore(Stores.LATEST)
    try:
        reader = AnyReader([path], default_typestore=store)
        reader.open()
    except OSError:
        raise
    except Exception as error:  # rosbags raises errors of any kind for damaged content
        raise damaged(path, error) from error

    def messages(topics: Sequence[str]) -> Iterator[Message]:
        connections = [c for c in reader.connections if c.topic in topics]
        try:
            for connection, recorded, data in reader.messages(connections):
                decode = partial(reader.deserialize, data, connection.msgtype)
                yield connection.topic, recorded, decode
        except OSError:
            raise
        except Exception as error:
            raise damaged(path, error) from error

    with contextlib.closing(reader):
        topics = {connection.topic: None for connection in reader.connections}
        return tables_of(path, list(topics), messages, pick, wanted)


def damaged(path: Path, error: Exception) -> InputError:
    """The one line that refuses a damaged file."""
    return InputError(f"{path}: cannot be read as a ROS bag: {' '.join(str(error).split())}")
