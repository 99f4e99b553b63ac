"""Choose the panels and the scales of the axes for a figure with very different values.

The values can differ by orders of magnitude, for example the stiffness of a soft and a hard
specimen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

WIDE = 10.0
"""Largest ratio of the magnitudes of the values on a linear axis. If the ratio is larger, the
groups are divided between several panels, or the axis is logarithmic."""
WIDE_SIGNED = 20.0
"""As `WIDE`, if some values are negative or zero. This limit is larger than `WIDE`, because an axis
that is logarithmic above and below zero is hard to read."""
MOST_ROWS = 6
"""Largest number of rows of panels."""

DECADES = 4
"""Largest number of intervals between labelled values, on each side of zero, if an axis is
logarithmic for positive and negative values."""
MINUS = "\u2212"
"""Minus sign, as matplotlib writes it."""
Interval = tuple[float, float]
"""Lower and upper end of an interval."""
Drawn = Mapping[tuple[str, ...], Sequence[Sequence[Interval]]]
"""Intervals that are drawn for a group, by its levels: one list for each quantity."""


def factor_of_rows(drawn: Drawn) -> int | None:
    """Return the factor that divides a figure into rows of panels, as an index; None for one row.

    The figure shows groups of recordings. If the figure is divided, each row contains the groups
    with one level of the factor.

    A linear axis is useful only for values of similar magnitude. The figure is therefore divided
    if, for a quantity, the ratio of the largest to the smallest magnitude is above `WIDE`. The
    chosen factor makes the largest ratio within a row as small as possible. The result is None if
    no division is needed, or if no factor is suitable. A suitable factor makes the ratio smaller
    and gives at most `MOST_ROWS` rows.
    """
    best, least = None, widest([*drawn.values()])
    if least <= WIDE:
        return None
    factors = range(len(next(iter(drawn))))
    for i in factors if len(factors) > 1 else ():
        levels = {group[i] for group in drawn}
        rows = [[drawn[group] for group in drawn if group[i] == level] for level in levels]
        ratio = max(widest(row) for row in rows)
        if 1 < len(levels) <= MOST_ROWS and ratio < least:
            best, least = i, ratio
    return best


def widest(groups: Sequence[Sequence[Sequence[Interval]]]) -> float:
    """Return the largest `size_ratio` of a quantity over several groups (intervals by quantity)."""
    quantities = zip(*groups, strict=True)
    return max((size_ratio([i for part in one for i in part]) for one in quantities), default=1.0)


def sizes(intervals: Sequence[Interval]) -> list[float]:
    """Return the larger absolute value of the ends of each interval, except zeros."""
    return [size for low, high in intervals if (size := max(abs(low), abs(high))) > 0.0]


def size_ratio(intervals: Sequence[Interval]) -> float:
    """Return the ratio of the largest to the smallest of the `sizes`; 1 if there are none."""
    found = sizes(intervals)
    return max(found) / min(found) if found else 1.0


def set_scale(axes: Axes, intervals: Sequence[Interval]) -> None:
    """Set the scale of the vertical axis according to the values that are drawn.

    The scale depends on the ratio of the largest to the smallest magnitude of the values:

    - If the ratio is small, the axis is linear. The limit of the ratio is `WIDE` if all values are
      positive, and `WIDE_SIGNED` otherwise.
    - If the ratio is larger and all values are positive, the axis is logarithmic.
    - If the ratio is larger and some values are negative or zero, the axis is linear near zero. It
      is logarithmic above and below this linear part. The linear part ends at the power of ten that
      is nearest to the smallest magnitude.
    - If there are no values, the axis has no ticks.
    """
    if not intervals:
        axes.set_yticks([])
        return
    ratio, lowest = size_ratio(intervals), min(low for low, _ in intervals)
    positive = lowest > 0.0
    if ratio <= (WIDE if positive else WIDE_SIGNED):
        return
    if positive:
        axes.set_yscale("log")
        narrow = max(high for _, high in intervals) < 1e3 * lowest
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if narrow else (1,)))
    else:
        found = sizes(intervals)
        first, last = round(math.log10(min(found))), math.ceil(math.log10(max(found)))
        axes.set_yscale("symlog", linthresh=10.0**first)
        step = math.ceil((last - first) / DECADES)
        powers = [10.0**n for n in range(first, last + 1, step)]
        axes.yaxis.set_major_locator(FixedLocator([*(-one for one in powers), 0.0, *powers]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", MINUS)))
