"""Store parts of a long recording in memory: evenly spaced sections, and the end."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np

from estimation.arrays import Floats

MEASURED = ("time", "paired_position", "paired_force", "paired_dt")
"""Columns of a recording that the estimators need: time, position, force, and time since the
previous sample."""
SECTION = 16.0
"""Duration of a section of a long recording [s]. The batch evaluation needs several cycles of the
palpation. Therefore, the duration of a section is constant, not its number of samples."""
SECTIONS = 5
"""Largest number of sections of a recording that are kept in memory."""
LAST = 1 << 15
"""Approximate largest number of ticks (steps of the control loop) at the end of a recording whose
columns are kept."""


class Sections:
    """Stores evenly spaced sections of a long recording, to limit the memory.

    The samples arrive in blocks. They are divided into sections of the duration `SECTION` [s], and
    at most `SECTIONS` sections are stored. If one more section must be stored, every second section
    is dropped. From then on, only half as many of the new sections are stored. The number of
    samples in a section is computed from the median sample period of the first block.
    """

    def __init__(self) -> None:
        self.count = 0
        """Number of all samples that were added, including those that were dropped."""
        self._size = 0
        self._every = 1
        self._kept: dict[int, list[Floats]] = {}

    def add(self, samples: Floats) -> None:
        """Add the next samples of the recording.

        Parameters
        ----------
        samples
            Array of shape (channels, n). The first rows are the columns `MEASURED`.
        """
        if not self._size and samples.shape[1]:
            period = float(np.median(samples[MEASURED.index("paired_dt")]))
            self._size = max(1, round(SECTION / period))
        while samples.shape[1]:
            number, inside = divmod(self.count, self._size)
            part = samples[:, : self._size - inside]
            samples = samples[:, self._size - inside :]
            self.count += part.shape[1]
            if number % self._every == 0:
                self._kept.setdefault(number, []).append(part.copy())
            if len(self._kept) > SECTIONS:
                self._every *= 2
                self._kept = {i: one for i, one in self._kept.items() if i % self._every == 0}

    def samples(self) -> Floats:
        """Return the samples of all stored sections in one array of shape (channels, n).

        The sections follow one another in the order of time.
        """
        parts = [part for section in self._kept.values() for part in section]
        return np.concatenate(parts, axis=1) if parts else np.empty((len(MEASURED), 0))

    @property
    def starts(self) -> Sequence[int]:
        """Indices in the array of `samples` at which a section begins after a gap in time.

        They are the indices of the first sample of each stored section except the first section. If
        no section was dropped, there are no gaps, and the list is empty.
        """
        size = self._size
        return [] if self._every == 1 else list(range(size, len(self._kept) * size, size))


class Last:
    """Stores the end of a recording that arrives in blocks: about the last `LAST` ticks.

    A tick is one step of the control loop. Earlier ticks are dropped.
    """

    def __init__(self) -> None:
        self._blocks: deque[dict[str, Floats]] = deque()
        self._count = 0

    def add(self, block: dict[str, Floats]) -> None:
        """Add the next ticks: arrays of shape (n,) by the name of the column.

        A tick is one step of the control loop. Each block must have the same columns.
        """
        size = len(next(iter(block.values()), ()))
        self._blocks.append({name: column.copy() for name, column in block.items()})
        self._count += size
        while self._count - self._first_size >= LAST:
            self._count -= self._first_size
            self._blocks.popleft()

    @property
    def _first_size(self) -> int:
        return len(next(iter(self._blocks[0].values()), ()))

    def columns(self, names: Iterable[str]) -> dict[str, Floats]:
        """Return columns of the stored ticks (steps of the control loop), by name.

        To save memory, the returned columns are removed from this object. Each column can therefore
        be returned only once.
        """
        return {
            name: np.concatenate([np.empty(0), *(block.pop(name) for block in self._blocks)])
            for name in names
        }
