"""Write ticks and events to an MCAP file that can be read even if the process is killed."""

from __future__ import annotations

import contextlib
import io
import json
import logging
import os
import stat
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import foxglove
from foxglove import Channel, Context, Schema
from foxglove.mcap import MCAPWriteOptions

from teleop.errors import reason
from teleop.streams.message import BEGIN, MESSAGE_NAME

TICKS, EVENTS = "/tick", "/event"
"""Topics (names) of the MCAP channels that contain the ticks and the events."""
END = "end"
"""Name of the metadata record at the end of a trial, with the number of dropped ticks."""
INFO, ERROR = 2, 4
"""Severity levels of an event in the schema foxglove.Log."""
EVENT_SCHEMA = {
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "level": {"type": "integer"},
        "message": {"type": "string"},
        "name": {"type": "string"},
        "file": {"type": "string"},
        "line": {"type": "integer"},
    },
}
"""JSON schema of an event. Foxglove and Lichtblick show events of this schema in a log panel."""


class Disk(io.RawIOBase):
    """A file that is open for writing. Its first write error is stored in `error`.

    The MCAP writer of foxglove does not report write errors. If the path is a symbolic link, its
    target is written if `overwrite` is True. Otherwise an OSError is raised.
    """

    def __init__(self, path: Path, overwrite: bool) -> None:
        self._path = Path(os.path.realpath(path)) if overwrite else path
        self._file = self._path.open("wb" if overwrite else "xb", buffering=0)
        self._identifiable = self._is_at_path()
        self._regular = stat.S_ISREG(os.fstat(self._file.fileno()).st_mode)
        self.error: OSError | None = None

    @property
    def missing(self) -> str:
        """Reason why the file is no longer at its path; empty if it is there, or is closed."""
        if self._file.closed or not self._identifiable or self._is_at_path():
            return ""
        if os.fstat(self._file.fileno()).st_nlink == 0:
            return "the file was removed during the run"
        return "the file was moved, or its file system was unmounted, during the run"

    def _is_at_path(self) -> bool:
        try:
            return os.path.samestat(os.fstat(self._file.fileno()), self._path.stat())
        except OSError:
            return False

    def write(self, data: Any) -> int:
        """Write all bytes of `data`, and return their number."""
        try:
            rest = memoryview(data)
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = self.error or error
            raise
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Change the position in the file as `io.IOBase.seek` does."""
        return self._file.seek(offset, whence)

    def close(self) -> None:
        """Close the file. The system may report only now that it could not write earlier data."""
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error

    def remove(self) -> None:
        """Remove the file if it is a regular file. A device, such as `/dev/null`, is kept."""
        if self._regular:
            with contextlib.suppress(OSError):
                self._path.unlink()


class McapFile:
    """Writes ticks and events to an MCAP file.

    After each `flush`, all data that were written so far can be read from the file, even if the
    process is killed. After the first write error (`error`), all further data are discarded.
    """

    def __init__(
        self,
        path: Path,
        columns: Sequence[Sequence[str]],
        definition: str,
        metadata: Mapping[str, Mapping[str, str]],
        overwrite: bool = False,
    ) -> None:
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)
        foxglove.set_log_level("CRITICAL")
        self._start = 0
        self._disk = Disk(path, overwrite)
        self._context = context = Context()  # its channels close with it
        self._writer = foxglove.open_mcap(
            self._disk,
            context=context,
            writer_options=MCAPWriteOptions(profile="ros2", chunk_size=None),
        )
        units = {name: unit for name, unit, _ in columns}
        self._ticks = Channel(
            TICKS,
            schema=Schema(name=MESSAGE_NAME, encoding="ros2msg", data=definition.encode()),
            message_encoding="cdr",
            metadata=units,
            context=context,
        )
        self._events = Channel(EVENTS, schema=EVENT_SCHEMA, context=context)
        with self._suppressed_write_errors():
            for name, record in metadata.items():
                self._writer.write_metadata(name, dict(record))
            self._writer.flush()

    @property
    def error(self) -> OSError | None:
        """First write error; None if there was no error."""
        return self._disk.error

    @property
    def failure(self) -> str:
        """Text that describes the first write error; empty if there was no error."""
        return reason(self.error) if self.error else ""

    @property
    def missing(self) -> str:
        """Reason why the file is no longer at its path; empty if it is there, or is closed."""
        return self._disk.missing

    @contextlib.contextmanager
    def _suppressed_write_errors(self) -> Any:
        """Suppress write errors within a `with` block. The first one is stored in `error`."""
        try:
            yield
        except (RuntimeError, OSError):
            if self.error is None:
                raise

    def begin(self, start: int) -> None:
        """Write the first event, before the first tick. `start` is the wall-clock time [ns]."""
        self._start = start
        self.event({"time": 0.0, "text": BEGIN, "mode": "disconnected", "fault": None})
        self.flush()

    def tick(self, message: bytes, t: float) -> None:
        """Write the message of one tick at the time t [s] of the trial."""
        if self.error is None:
            self._ticks.log(message, log_time=self._start + round(t * 1e9))

    def event(self, event: Mapping[str, Any]) -> None:
        """Write one event, as `teleop.streams.stream.event_record` returns it."""
        if self.error is None:
            when = self._start + round(event["time"] * 1e9)
            log = {
                "timestamp": {"sec": when // 10**9, "nsec": when % 10**9},
                "level": ERROR if event["fault"] else INFO,
                "message": event["text"],
                "name": "safety",
                "file": "",
                "line": 0,
            }
            self._events.log(json.dumps({**log, **event}), log_time=when)

    def flush(self) -> None:
        """Write all buffered data to the file."""
        if self.error is None:
            with self._suppressed_write_errors():
                self._writer.flush()

    def end(self, dropped: int) -> None:
        """Write the number of ticks that were dropped in the whole trial.

        Each recorded tick contains only the number before it. Ticks after it may also have been
        dropped.
        """
        if self.error is None:
            with self._suppressed_write_errors():
                self._writer.write_metadata(END, {"dropped": str(dropped)})

    def close(self) -> None:
        """Write the last records of the MCAP file, and close the file."""
        with self._suppressed_write_errors():
            self._writer.close()
        self._disk.close()

    def remove(self) -> None:
        """Remove the closed file."""
        self._disk.remove()
