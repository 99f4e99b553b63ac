"""The parts of a long recording that are kept in memory: evenly spaced sections, and its end."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np

from estimation.compiled import Floats

MEASURED = ("time", "paired_position", "paired_force", "paired_dt")
"""Columns of the samples of the estimators: time, position, force, and time since the previous
sample."""
SECTION = 16.0
"""Duration of a section of a long recording [s]. The batch evaluation needs several cycles of the
palpation, so that the number of samples in a section depends on the rate."""
SECTIONS = 5
"""Largest number of sections of a recording that are kept in memory."""
LAST = 1 << 15
"""Approximate largest number of ticks at the end of a recording whose columns are kept."""


class Sections:
    """Evenly spaced sections of samples that arrive in blocks.

    A section has the duration `SECTION` [s], and at most `SECTIONS` sections are kept. If a further
    section arrives, every second section is dropped. The number of samples in a section is computed
    from the median sample period of the first block.
    """

    def __init__(self) -> None:
        self.count = 0
        """Number of all samples so far."""
        self._size = 0
        self._every = 1
        self._kept: dict[int, list[Floats]] = {}

    def add(self, samples: Floats) -> None:
        """Add samples, shape (channels, n)."""
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
        """Return the samples of the sections one after another, shape (channels, n)."""
        parts = [part for section in self._kept.values() for part in section]
        return np.concatenate(parts, axis=1) if parts else np.empty((len(MEASURED), 0))

    @property
    def starts(self) -> Sequence[int]:
        """Index of the first sample of each kept section, without the first section.

        The indices are those in the array that `samples` returns. The list is empty if no section
        was dropped, because there are no gaps between the sections in this case.
        """
        size = self._size
        return [] if self._every == 1 else list(range(size, len(self._kept) * size, size))


class Last:
    """Stores the last ticks of a recording whose columns arrive in blocks.

    About `LAST` ticks are stored. Older ticks are dropped.
    """

    def __init__(self) -> None:
        self._blocks: deque[dict[str, Floats]] = deque()
        self._count = 0

    def add(self, block: dict[str, Floats]) -> None:
        """Add a block of columns."""
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
        """Return the columns. Each column is removed from the blocks, to save memory."""
        return {
            name: np.concatenate([np.empty(0), *(block.pop(name) for block in self._blocks)])
            for name in names
        }
