"""The stream of one trial: ticks, events and estimates in rings that processes share.

The control loop writes ticks and events, and the estimation writes the estimates of the ticks. All
other parts read them: the recorder, which also shows the progress line, the live page, viewers of
the Foxglove protocol, the evaluation of the wanted precision, and a Python session (`READERS`). In
real time, each reader is a process of its own. In virtual time, the same readers run in the process
of the loop, after each block of ticks (`teleop.trial.readers`). The loop waits for no reader.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from mmap import mmap
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from estimation.arrays import Floats
from teleop.json_documents import dumps, finite, loads
from teleop.safety import Event
from teleop.streams.columns import DROPPED, Layout, Schema
from teleop.streams.ring import RingReader, RingWriter, ring_size
from teleop.streams.shared_file import SharedFile

if TYPE_CHECKING:
    from teleop.control.tick_record import Record

STORED = 40.0
"""Time for which the rings of a recorded trial store ticks [s]."""
EVENT_SLOTS, EVENT_SIZE = 256, 8176
"""Number of events in their ring, and largest size of an event [bytes]. The texts of an event have
up to 500 characters, each of which needs up to 12 bytes (see `dumps`)."""
LONGEST_TEXT = 400
"""Largest number of characters in the text of an event."""
EVENT = np.dtype([("tick", "u8"), ("length", "u8"), ("text", f"V{EVENT_SIZE}")])
"""An event: number of the tick at which it occurred, and its JSON document."""
READERS = ("recorder", "estimation", "live page", "foxglove", "evaluation", "python")
"""Readers in other processes, at most one of each. Each has a counter of the ticks that it has
missed, in the part `missed` of the memory."""
RECORDER = READERS.index("recorder")
PATIENCE = 5.0
"""Age of a tick above which it is read without its estimates, if they are late [s]."""


class Batch(NamedTuple):
    """Successive ticks, and the new events."""

    first: int
    """Number of the first tick, from 1."""
    written: Floats
    """Times at which the loop wrote the ticks, on the monotonic clock of the machine, (n,) [s]."""
    rows: Floats
    """Values of the ticks in the order of the columns, shape (n, columns)."""
    events: list[tuple[int, dict[str, Any]]]
    """Events up to the newest tick that was read, with the number of the tick at which each
    occurred. An event is written after its tick, so that it can follow in the next batch."""
    is_after_gap: bool
    """Whether ticks before the first one were missed."""


class Stream:
    """Writes the ticks and events of one trial, in the process of the control loop.

    Parameters
    ----------
    layout
        The columns of the trial.
    ticks
        Number of ticks that must be stored.
    shared
        Whether other processes read the stream.

    Attributes
    ----------
    events
        All events of the trial (`event_record`).
    """

    def __init__(self, layout: Layout, ticks: int, shared: bool = False) -> None:
        self.schema = layout.schema
        self.events: list[dict[str, Any]] = []
        slots = math.ceil(ticks * 8 / 7) + 64  # the oldest of a ring are not read
        self._sections = sections(self.schema, slots)
        self._files: dict[str, SharedFile] = {}
        self._memory: dict[str, mmap] = {}
        try:
            for name, (record, count) in self._sections.items():
                size = ring_size(record, count)
                if shared:
                    self._files[name] = SharedFile.create(size)
                    self._memory[name] = self._files[name].buffer
                else:
                    self._memory[name] = mmap(-1, size)
        except BaseException:
            self.unlink()
            raise
        self._ticks = self._writer("ticks")
        self._events = self._writer("events")
        self._estimates = RingReader(self._memory["estimates"], *self._sections["estimates"])
        self._missed = memoryview(self._memory["missed"]).cast("Q")
        self._write = layout.write

    @property
    def newest(self) -> int:
        """Number of the newest tick, from 1; 0 before the first tick."""
        return self._ticks.newest

    def write(self, record: Record) -> None:
        """Write a tick."""
        ticks = self._ticks
        dropped = self._missed[RECORDER]  # so that the live page can state it
        self._write(ticks.memory, ticks.place, monotonic(), record, dropped)
        ticks.publish()

    def event(self, event: Event) -> None:
        """Write an event of the newest tick."""
        self.events.append(event_record(event))
        text = dumps(self.events[-1]).encode()
        self._events.write(np.array([(self.newest, len(text), text)], EVENT))

    @property
    def missed(self) -> dict[str, int]:
        """Number of ticks that each reader in another process has stated to have missed."""
        return dict(zip(READERS, self._missed, strict=False))

    @property
    def estimated(self) -> int:
        """Number of the newest tick whose estimates were computed."""
        return self._estimates.newest

    @property
    def document(self) -> dict[str, Any]:
        """Description with which another process opens the stream (`StreamReader.open`)."""
        return {
            "files": {name: str(file.path) for name, file in self._files.items()},
            "slots": self._sections["ticks"][1],
            "schema": self.schema._asdict(),
        }

    def reader(self) -> StreamReader:
        """Return a reader in this process."""
        return StreamReader(self.schema, self._memory, self._sections["ticks"][1])

    def _writer(self, name: str) -> RingWriter:
        return RingWriter(self._memory[name], *self._sections[name])

    def unlink(self) -> None:
        """Remove the names of the shared memory. Processes that have opened it can still read."""
        for file in self._files.values():
            file.remove()


def sections(schema: Schema, slots: int) -> dict[str, tuple[np.dtype[Any], int]]:
    """Return the type and the number of the records in each part of the memory, by its name."""
    return {
        "ticks": (np.dtype((np.float64, 1 + len(schema.loop))), slots),
        "estimates": (np.dtype((np.float64, len(schema.estimation))), slots),
        "events": (EVENT, EVENT_SLOTS),
        "missed": (np.dtype(np.uint64), len(READERS)),
    }


class StreamReader:
    """Reads the ticks of a stream one after another, with their events and estimates.

    Parameters
    ----------
    schema
        Names of the columns.
    memory
        Memory of each part of the stream, by its name.
    slots
        Number of ticks in the ring.
    name
        Name of the reader in `READERS`; empty for a reader in the process of the loop.

    Attributes
    ----------
    position
        Number of the newest tick that was read or missed.
    missed
        Number of ticks that were overwritten before they were read.
    patience
        Longest time for which `read` withholds a tick whose estimates are not computed yet [s].
    """

    def __init__(
        self, schema: Schema, memory: Mapping[str, mmap], slots: int, name: str = ""
    ) -> None:
        parts = sections(schema, slots)
        self.schema = schema
        self._memory, self._sections = memory, parts
        self.ticks, self.estimates, self._events = (
            RingReader(memory[part], *parts[part]) for part in ("ticks", "estimates", "events")
        )
        self.position = self.missed = 0
        self.patience = PATIENCE
        self._event = 0
        """Number of the newest event that was read."""
        self._is_after_gap = False
        """Whether ticks were missed since the last ones that were returned."""
        self._cell = memoryview(memory["missed"]).cast("Q") if name else None
        self._index = READERS.index(name) if name else 0
        place = {column.name: i for i, column in enumerate(schema.columns)}
        self._loop = [place[column] for column in schema.loop]
        self._estimation = [place[column] for column in schema.estimation]
        self._dropped = place[DROPPED.name]

    @classmethod
    def open(cls, document: Mapping[str, Any], name: str) -> StreamReader:
        """Open the stream of another process; `name` is one of `READERS`."""
        written = {"missed", "estimates"} if name == "estimation" else {"missed"}
        memory = {
            part: SharedFile.open(Path(path), part in written).buffer
            for part, path in document["files"].items()
        }
        return cls(Schema.of(document["schema"]), memory, document["slots"], name)

    @property
    def is_behind(self) -> bool:
        """Whether there are ticks or events that were not read, or are withheld."""
        return self.position < self.ticks.newest or self._event < self._events.newest

    def read(self, most: int = 1 << 14) -> Batch | None:
        """Return the next ticks, at most `most`; None if there is neither a tick nor an event."""
        before = self.position
        end = min(self._end() + 1, max(before + 1, self.ticks.oldest) + most)
        first, written, rows = self.rows(before + 1, end)
        self.position = first - 1 + len(rows)
        if first > before + 1:
            self._is_after_gap = True
            self.miss(first - before - 1)
        rows[:, self._dropped] = np.maximum(rows[:, self._dropped], self.missed)
        events = list(self._new_events())
        if not (len(rows) or events):
            return None
        is_after_gap = self._is_after_gap
        self._is_after_gap = is_after_gap and not len(rows)
        return Batch(first, written, rows, events, is_after_gap)

    def miss(self, ticks: int) -> None:
        """Count ticks that were overwritten before they were read."""
        self.missed += ticks
        if self._cell:
            self._cell[self._index] = self.missed

    def estimates_writer(self) -> RingWriter:
        """Return the writer of the estimates. Only the reader that computes them calls it, once."""
        return RingWriter(self._memory["estimates"], *self._sections["estimates"])

    def rows(self, first: int, end: int) -> tuple[int, Floats, Floats]:
        """Return the ticks from number `first` to `end` - 1 that the ring still contains.

        The result is the number of the first one, the times of writing, shape (n,), and the values,
        shape (n, columns). Estimates that do not exist are NaN.
        """
        first, ticks = self.ticks.read(first, end)
        rows = np.full((len(ticks), len(self.schema.columns)), np.nan)
        rows[:, self._loop] = ticks[:, 1:]
        start, estimates = self.estimates.read(first, first + len(ticks))
        part = slice(start - first, start - first + len(estimates))
        rows[part, self._estimation] = estimates
        return first, ticks[:, 0], rows

    def columns(self, first: int, end: int) -> dict[str, Floats]:
        """Return the columns of the ticks that `rows` returns, by name, each of shape (n,)."""
        rows = self.rows(first, end)[2]
        return columns_of(self.schema, rows)

    def _end(self) -> int:
        """Return the number of the newest tick that can be read now.

        A tick is withheld until its estimates are computed, but not longer than `patience`. While
        the estimates are later than that, nothing is withheld.
        """
        newest, done = self.ticks.newest, self.estimates.newest
        if done >= newest:
            return newest
        _, waiting = self.ticks.read(done + 1, done + 2)
        if len(waiting) and monotonic() - waiting[0, 0] <= self.patience:
            return done
        return newest

    def _new_events(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the events up to the position."""
        first, records = self._events.read(self._event + 1, self._events.newest + 1)
        for number, record in enumerate(records, first):
            if record["tick"] > self.position:
                return
            self._event = number
            yield int(record["tick"]), loads(record["text"].tobytes()[: record["length"]])


def columns_of(schema: Schema, rows: Floats) -> dict[str, Floats]:
    """Return the columns of rows, shape (n, columns), by name, each of shape (n,)."""
    names = (column.name for column in schema.columns)
    return dict(zip(names, np.ascontiguousarray(rows.T), strict=True))


def event_record(event: Event) -> dict[str, Any]:
    """Return an event as a dictionary of values that JSON allows. Long texts are shortened."""
    record: dict[str, Any] = finite(event._asdict())
    return record | {
        "mode": event.mode.name.lower(),
        "text": event.text[:LONGEST_TEXT],
        "fault": event.fault and str(event.fault),
        "source": event.source[:100],
    }
