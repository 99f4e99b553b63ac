"""Gaps in time: where samples are missing, and how signals are conditioned across them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation import Conditioner, Regression
from estimation.compiled import Floats

LONG = 20.0
"""A sample period longer than this many median periods is a gap."""
SAME_TIME = 1e-6
"""Times that differ by less are equal [s]."""
LISTED = 4
"""Most gaps that a text lists."""


class Gap(NamedTuple):
    """A stretch of time without ticks in a recording of ticks."""

    start: float | None
    """Time of the last tick before it [s]; None where the recording begins with it."""
    end: float | None
    """Time of the first tick after it [s]; None where the recording ends with it."""
    ticks: int
    """How many ticks are missing."""

    @property
    def text(self) -> str:
        """Where it is."""
        if self.start is None:
            return f"{self.ticks} before {self.end:.3f} s"
        if self.end is None:
            return f"{self.ticks} after {self.start:.3f} s"
        return f"{self.ticks} from {self.start:.3f} to {self.end:.3f} s"


def missing_ticks(t: Floats, dt: Floats, dropped: Floats, in_all: int = 0) -> tuple[Gap, ...]:
    """Where ticks are missing from a recording.

    The loop measures `dt` itself, so a tick is missing where the recorded times are further
    apart than that. A loop that skipped periods leaves no gap of this kind.

    Parameters
    ----------
    t
        Time of each recorded tick [s], shape (n,).
    dt
        Time since the tick before, recorded or not [s], shape (n,).
    dropped
        Number of ticks dropped before each, shape (n,).
    in_all
        Number of ticks dropped by the end of the run.
    """
    if not len(t):
        return ()
    after = 1 + np.flatnonzero(np.diff(t) - dt[1:] > SAME_TIME)
    lost = np.nan_to_num(np.diff(dropped, prepend=dropped[0]))
    gaps = [Gap(float(t[i - 1]), float(t[i]), int(lost[i])) for i in after]
    if in_all and (first := int(np.nan_to_num(dropped[0]))) > 0:
        gaps.insert(0, Gap(None, float(t[0]), first))
    if (rest := in_all - int(np.nan_to_num(dropped[-1]))) > 0:
        gaps.append(Gap(float(t[-1]), None, rest))
    return tuple(gaps)


def missing_text(gaps: Sequence[Gap]) -> str:
    """How many ticks are missing, and where; empty for no gap."""
    if not gaps:
        return ""
    places = ", ".join(gap.text for gap in gaps[:LISTED])
    more = f" and {len(gaps) - LISTED} more gaps" if len(gaps) > LISTED else ""
    count = sum(gap.ticks for gap in gaps)
    return f"{count} ticks are missing from the recording: {places}{more}"


def gap_rows(gaps: Sequence[Gap]) -> list[dict[str, Any]]:
    """The gaps as `--json` prints them."""
    return [{"from_s": gap.start, "to_s": gap.end, "ticks": gap.ticks} for gap in gaps]


def long_periods(dt: Floats) -> NDArray[np.intp]:
    """The samples before which there is a gap, going by the median period."""
    return np.flatnonzero(dt > LONG * np.median(dt))


def closed_up(dt: Floats, gaps: Sequence[int]) -> Floats:
    """Sample periods with the median period in place of each gap.

    Parameters
    ----------
    dt
        Time since the sample before [s], shape (n,).
    gaps
        Numbers of the samples before which samples are missing.
    """
    periods = dt.copy()
    periods[list(gaps)] = np.median(dt)
    return periods


def condition(
    conditioner: Conditioner,
    t: Floats,
    x: Floats,
    f: Floats,
    dt: Floats,
    gaps: Sequence[int],
) -> tuple[Regression, NDArray[np.bool_]]:
    """Condition signals between gaps, over which nothing is known of position and force.

    Parameters
    ----------
    conditioner
        Is reset at each gap.
    t, x, f, dt
        Time [s], position [m], force [N] and time since the sample before [s], each of shape
        (n,).
    gaps
        Numbers of the samples before which samples are missing.

    Returns
    -------
    The regression, and for which samples the filters have settled since the gap before them,
    both of n samples.
    """
    bounds = sorted({0, len(t), *gaps})
    settled = np.ones(len(t), dtype=np.bool_)
    parts = []
    for start, end in pairwise(bounds):
        conditioner.reset()
        parts.append(conditioner.run(x[start:end], f[start:end], dt[start:end]))
        if start in gaps:
            settled[start:end] = t[start:end] - t[start] > conditioner.settling
    return Regression(*(np.concatenate(channel) for channel in zip(*parts, strict=True))), settled
