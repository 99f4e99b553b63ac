"""A recording whose ticks are not kept in memory, but are read from the file in blocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from teleop.errors import InputError
from teleop.recording.recording import Recording, load_intact
from teleop.recording.stream import RecordingStream

MOST_VALUES_IN_MEMORY = 1 << 22
"""Largest number of values (ticks times columns) of a recorded trial that are kept in memory."""


class RecordingFile:
    """The intact part of a recording whose ticks are not kept in memory.

    Each method that returns ticks reads them from the file again.
    """

    def __init__(self, path: Path) -> None:
        stream = RecordingStream(path)
        stream.read_through()
        self.path = path
        self.units = stream.units
        """Unit of each column, by its name."""
        self.events = stream.events
        self.gaps = stream.gaps
        self._ticks = stream.ticks
        self._empty = Recording(
            {}, self.units, self.events, stream.session, stream.settings, self.gaps
        )

    def __len__(self) -> int:
        """Return the number of intact ticks in the file."""
        return self._ticks

    @property
    def fault(self) -> dict[str, Any] | None:
        """Event of the reported fault (see `reported_fault`); None if there was no fault."""
        return self._empty.fault

    def blocks(self, is_wanted: Callable[[str], bool] = bool) -> Iterator[Recording]:
        """Yield each block of successive ticks as a recording, with the wanted columns."""
        for columns in RecordingStream(self.path).intact_blocks(is_wanted):
            yield replace(self._empty, columns=columns)

    def load(self) -> Recording:
        """Read all intact ticks into memory."""
        return load_intact(self.path)

    def evenly_spaced(self) -> Recording:
        """Return every n-th of the ticks at which the estimators were updated, and the last one.

        n is chosen such that the result has at most about `MOST_VALUES_IN_MEMORY` values (ticks
        times columns).
        """
        every = max(1, math.ceil(self._ticks * len(self.units) / MOST_VALUES_IN_MEMORY))
        parts: list[Recording] = []
        last, count = replace(self._empty, columns={name: np.empty(0) for name in self.units}), 0
        for block in self.blocks():
            estimated = block.estimated()
            if not len(estimated):
                continue
            indices = np.arange(len(estimated))
            parts.append(estimated.where((count + indices) % every == 0))
            count += len(estimated)
            last = estimated.where(indices == indices[-1])
        if (count - 1) % every:
            parts.append(last)
        columns = {
            name: np.concatenate([np.empty(0), *(part[name] for part in parts)])
            for name in self.units
        }
        return replace(self._empty, columns=columns)


def recorded_ticks(path: Path) -> Recording | RecordingFile | None:
    """Return the intact ticks of a recording; None if the file cannot be read.

    If the file is larger than `MOST_VALUES_IN_MEMORY` values of 8 bytes, they are read from the
    file at each use.
    """
    try:
        if path.stat().st_size > 8 * MOST_VALUES_IN_MEMORY:
            return RecordingFile(path)
        return load_intact(path)
    except (OSError, InputError):
        return None
