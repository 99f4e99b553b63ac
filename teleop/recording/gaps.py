"""Find the gaps in a recording. In a gap, ticks are missing because the recorder was too slow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from estimation.arrays import Floats

SAME_TIME = 1e-6
"""Largest difference between two times that are treated as equal [s]."""
LISTED = 4
"""Largest number of gaps that a message lists."""


class Gap(NamedTuple):
    """A part of a recording in which ticks are missing."""

    start: float | None
    """Time of the last tick before the gap [s]; None if the recording begins with the gap."""
    end: float | None
    """Time of the first tick after the gap [s]; None if the recording ends with the gap."""
    ticks: int
    """Number of missing ticks."""

    @property
    def text(self) -> str:
        """Number of missing ticks and time of the gap [s], as a part of a message."""
        if self.start is None:
            return f"{self.ticks} before {self.end:.3f} s"
        if self.end is None:
            return f"{self.ticks} after {self.start:.3f} s"
        return f"{self.ticks} from {self.start:.3f} to {self.end:.3f} s"


def missing_ticks(
    t: Floats, dt: Floats, dropped: Floats, total_dropped: int = 0
) -> tuple[Gap, ...]:
    """Return the gaps of a recording from the columns `time`, `dt` and `dropped`.

    `dt` is the time since the previous tick, even if that tick was not recorded. If the time since
    the previous recorded tick is larger than `dt`, there is a gap between the two. If the loop
    itself was late and skipped a period, this is not a gap: `dt` contains the skipped period.

    The gaps before the first and after the last recorded tick are found only if `total_dropped`,
    the number of ticks dropped in the whole trial, is known (not 0).
    """
    finder = GapFinder()
    finder.add(t, dt, dropped)
    return finder.gaps(total_dropped)


class GapFinder:
    """Finds the gaps of a recording that is read in blocks; see `missing_ticks`."""

    def __init__(self) -> None:
        self._found: list[Gap] = []
        self._first: tuple[float, float] | None = None
        self._last = (0.0, 0.0)

    def add(self, t: Floats, dt: Floats, dropped: Floats) -> None:
        """Process the columns `time`, `dt` and `dropped` of the next recorded ticks."""
        if not len(t):
            return
        before, lost_before = self._last
        if self._first is None:
            self._first = float(t[0]), float(dropped[0])
            before, lost_before = np.nan, dropped[0]
        steps = np.diff(t, prepend=before)
        lost = np.nan_to_num(np.diff(dropped, prepend=lost_before))
        starts = np.concatenate(([before], t[:-1]))
        for i in np.flatnonzero(steps - dt > SAME_TIME):
            self._found.append(Gap(float(starts[i]), float(t[i]), int(lost[i])))
        self._last = float(t[-1]), float(dropped[-1])

    def gaps(self, total_dropped: int = 0) -> tuple[Gap, ...]:
        """Return the gaps in the ticks that were added."""
        if self._first is None:
            return ()
        gaps = list(self._found)
        if total_dropped and (first := int(np.nan_to_num(self._first[1]))) > 0:
            gaps.insert(0, Gap(None, self._first[0], first))
        if (rest := total_dropped - int(np.nan_to_num(self._last[1]))) > 0:
            gaps.append(Gap(self._last[0], None, rest))
        return tuple(gaps)


def missing_text(gaps: Sequence[Gap]) -> str:
    """Return a message with the number and the times of missing ticks; empty without gaps."""
    if not gaps:
        return ""
    places = ", ".join(gap.text for gap in gaps[:LISTED])
    more = f" and {len(gaps) - LISTED} more gaps" if len(gaps) > LISTED else ""
    count = sum(gap.ticks for gap in gaps)
    return f"{count} ticks are missing from the recording: {places}{more}"


def gap_rows(gaps: Sequence[Gap]) -> list[dict[str, Any]]:
    """Return the gaps as dictionaries for a JSON document, with times in seconds."""
    return [{"from_s": gap.start, "to_s": gap.end, "ticks": gap.ticks} for gap in gaps]
