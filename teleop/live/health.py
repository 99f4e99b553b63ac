"""Count the timing problems of the control loop during a trial."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from estimation.arrays import Floats

RECENT = 1.0
"""Length of the time window [s]. The live page shows the largest lateness within this window."""


class Health:
    """Counts overruns, skipped periods and dropped ticks of a trial.

    An overrun is a tick of the control loop that starts late, because the previous tick was still
    running at the planned start. A skipped period is a period without a tick, because the previous
    tick took too long. A dropped tick is a tick that the recorder did not receive.
    """

    def __init__(self) -> None:
        self._overruns = self._skipped = self._dropped = 0
        self._latenesses: deque[tuple[float, float]] = deque()

    def add(self, values: Floats, column: Mapping[str, int], now: float) -> None:
        """Add new ticks to the counts of overruns, skipped periods and dropped ticks.

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
        """Return the counts of timing problems, and the largest lateness [s], by their names.

        The lateness is the delay of a tick after its planned start. Its largest value in the last
        `RECENT` seconds is returned; None if no tick was added in this time.

        Parameters
        ----------
        now
            Present time [s].
        """
        while self._latenesses and self._latenesses[0][0] < now - RECENT:
            self._latenesses.popleft()
        return {
            "overruns": self._overruns,
            "skipped": self._skipped,
            "dropped": self._dropped,
            "lateness_max": max((late for _, late in self._latenesses), default=None),
        }
