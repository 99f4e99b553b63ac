"""Choose the panels and the axes of a figure whose values differ by orders of magnitude."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

WIDE = 10.0
"""Ratio of the largest to the smallest size of the values in a panel above which the groups are
divided between several panels, or the axis is logarithmic."""
WIDE_SIGNED = 20.0
"""This ratio for an axis that is logarithmic for positive and negative values. Such an axis is hard
to read. Up to this ratio, a linear axis still shows the smallest values."""
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
"""Intervals that are drawn for each quantity, by the levels of a group."""


def factor_of_rows(drawn: Drawn) -> int | None:
    """Return the index of the factor whose levels have separate rows of panels; None for one row.

    A linear axis is useful only for values of similar size. Therefore the groups are divided into
    rows if the ratio of the largest to the smallest size of a quantity is above `WIDE`. The chosen
    factor makes the largest ratio within a row as small as possible. The result is None if no
    division is needed, or if no factor is suitable.

    Parameters
    ----------
    drawn
        Intervals that are drawn for each quantity, by the levels of a group.
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
    """Return the ratio of the largest to the smallest size of a quantity in these groups.

    If there are several quantities, it is the largest of their ratios.
    """
    quantities = zip(*groups, strict=True)
    return max((size_ratio([i for part in one for i in part]) for one in quantities), default=1.0)


def sizes(intervals: Sequence[Interval]) -> list[float]:
    """Return the size of each interval, without the sizes that are zero.

    The size is the largest absolute value in the interval.
    """
    return [size for low, high in intervals if (size := max(abs(low), abs(high))) > 0.0]


def size_ratio(intervals: Sequence[Interval]) -> float:
    """Return the ratio of the largest to the smallest size of intervals; 1 without intervals."""
    found = sizes(intervals)
    return max(found) / min(found) if found else 1.0


def set_scale(axes: Axes, intervals: Sequence[Interval]) -> None:
    """Set the scale of the vertical axis.

    - If the sizes of the intervals are similar, the axis is linear.
    - If the sizes differ and all values are positive, the axis is logarithmic.
    - If the sizes differ and some values are not positive, the axis is linear near zero and
      logarithmic for larger magnitudes. The linear range ends at the power of ten that is nearest
      to the smallest size.
    - If there are no intervals, the axis has no ticks.

    Parameters
    ----------
    axes
        The axes.
    intervals
        Lower and upper ends of the intervals that the axes show.
    """
    if not intervals:
        axes.set_yticks([])
        return
    ratio, positive = size_ratio(intervals), min(low for low, _ in intervals) > 0.0
    if ratio <= (WIDE if positive else WIDE_SIGNED):
        return
    if positive:
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if ratio < 1e3 else (1,)))
    else:
        found = sizes(intervals)
        first, last = round(math.log10(min(found))), math.ceil(math.log10(max(found)))
        axes.set_yscale("symlog", linthresh=10.0**first)
        step = math.ceil((last - first) / DECADES)
        powers = [10.0**n for n in range(first, last + 1, step)]
        axes.yaxis.set_major_locator(FixedLocator([*(-one for one in powers), 0.0, *powers]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", MINUS)))
