"""Read a recording in blocks of ticks, so that only one block at a time is in memory."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from estimation.arrays import Floats
from teleop.errors import InputError
from teleop.recording.gaps import Gap, GapFinder
from teleop.recording.mcap_reader import Contents, read_ticks
from teleop.recording.mcap_writer import END
from teleop.streams.message import FIELD, tick_values

BLOCK = 1 << 14
"""Smallest number of ticks in a block; the last block may be smaller."""
OF_GAPS = ("time", "dt", "dropped")
"""Columns that are needed to find missing ticks."""


class RecordingStream:
    """A recording that can be read only once, in blocks of successive ticks.

    `units`, `session` and `settings` are known before the first block is read. `events`, `gaps` and
    `ticks` are complete after the last block.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.contents = Contents()
        self.ticks = 0
        """Number of ticks that were read."""
        self.last_time = 0.0
        """Time of the last tick that was read [s]."""
        self._gaps = GapFinder()
        self._rows = read_ticks(path, self.contents)
        self._first = next(self._rows, None)
        fields = FIELD.findall(self.contents.definition)
        self.units = {name: unit for name, unit, _ in fields}
        """Unit of each column, by its name, in the order of the columns."""

    @property
    def session(self) -> dict[str, str]:
        """Texts about the session by name, for example software, machine and date."""
        return self.contents.metadata.get("session", {})

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the trial, for example its condition and duration."""
        settings: dict[str, Any] = json.loads(
            self.contents.metadata.get("settings", {}).get("json", "{}")
        )
        return settings

    @property
    def events(self) -> list[dict[str, Any]]:
        """Faults and mode changes in the part of the recording that has been read so far."""
        return self.contents.events

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """Gaps (missing ticks) in the part of the recording that has been read so far."""
        return self._gaps.gaps(dropped_in_all(self.contents.metadata))

    def blocks(self, is_wanted: Callable[[str], bool] = bool) -> Iterator[dict[str, Floats]]:
        """Yield the blocks of ticks as dictionaries of the wanted columns.

        If the recording is not complete, an InputError follows the last intact tick. It names the
        command that recovers the intact part.
        """
        yield from self.intact_blocks(is_wanted)
        if self.contents.damage:
            kept = (
                f"{max(self.last_time, 0.0):.3f} s are intact"
                if self.ticks
                else "no tick is intact"
            )
            raise InputError(
                f"{self.path}: the recording is not complete ({self.contents.damage}): {kept}; "
                f"recover it with: teleop recover {self.path}"
            )

    def intact_blocks(self, is_wanted: Callable[[str], bool] = bool) -> Iterator[dict[str, Floats]]:
        """Yield the same blocks as `blocks`, without an error at the end of the intact part."""
        names = list(self.units)
        wanted = [name for name in names if is_wanted(name)]
        needed = [name for i, name in enumerate(names) if i == 0 or name in (*OF_GAPS, *wanted)]
        has_gaps = set(OF_GAPS) <= set(names)
        for values in self._joined([names.index(name) for name in needed]):
            self.ticks += values.shape[1]
            self.last_time = float(values[0, -1])
            columns = dict(zip(needed, values, strict=True))
            if has_gaps:
                self._gaps.add(*(columns[name] for name in OF_GAPS))
            yield {name: columns[name] for name in wanted}

    def read_through(self) -> None:
        """Read to the end, so that `events`, `gaps` and `ticks` are complete."""
        for _ in self.intact_blocks(lambda name: False):
            pass

    def _joined(self, columns: Sequence[int]) -> Iterator[Floats]:
        """Yield blocks of at least `BLOCK` ticks (except the last), shape (columns, ticks)."""
        values: list[Floats] = []
        count = 0
        rows = chain(() if self._first is None else (self._first,), self._rows)
        self._first = None
        for more in rows:
            values.append(tick_values(more, columns))
            count += len(more)
            if count >= BLOCK:
                yield np.concatenate(values, axis=1)
                values, count = [], 0
        if values:
            yield np.concatenate(values, axis=1)


def dropped_in_all(metadata: dict[str, dict[str, str]]) -> int:
    """Return the number of ticks dropped in the whole trial, from the metadata; 0 if unknown."""
    text = metadata.get(END, {}).get("dropped", "")
    return int(text) if re.fullmatch(r"[0-9]{1,15}", text) else 0
