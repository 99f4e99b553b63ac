"""Count the timing problems of the control loop during a trial."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from estimation.compiled import Floats

RECENT = 1.0
"""Length of the time window [s]. The live page shows the largest lateness within this window."""


class Health:
    """Counts overruns, skipped periods and dropped ticks of a trial."""

    def __init__(self) -> None:
        self._overruns = self._skipped = self._dropped = 0
        self._latenesses: deque[tuple[float, float]] = deque()

    def add(self, values: Floats, column: Mapping[str, int], now: float) -> None:
        """Add ticks to the counts.

        Parameters
        ----------
        values
            All columns of the ticks, shape (n, columns), n > 0.
        column
            Index of each column by its name.
        now
            Present time [s].
        """
        self._overruns += int(values[:, column["overrun"]].sum())
        self._skipped += int(values[:, column["skipped"]].sum())
        self._dropped = int(values[-1, column["dropped"]])
        self._latenesses.append((now, float(np.max(values[:, column["lateness"]]))))

    def document(self, now: float) -> dict[str, Any]:
        """Return the counts, and the largest lateness of the last second [s]."""
        while self._latenesses and self._latenesses[0][0] < now - RECENT:
            self._latenesses.popleft()
        return {
            "overruns": self._overruns,
            "skipped": self._skipped,
            "dropped": self._dropped,
            "lateness_max": max((late for _, late in self._latenesses), default=None),
        }
