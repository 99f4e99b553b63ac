"""Draw stiffness k and damping b of several recordings, which are grouped by factors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimation.figure_style import BLUE, common_legend, name_ticks, new_figure, tidy
from estimation.quantities import DAMPING, STIFFNESS
from teleop.evaluation.across.comparison import RESULT, Compared
from teleop.evaluation.across.groups import Group
from teleop.evaluation.across.means import Mean
from teleop.evaluation.batch.kinds import BESIDES_RELAXATION, LOSS
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.output.comparison_scales import Interval, factor_of_rows, set_scale
from teleop.output.figure_files import plain

RECORDINGS = (-0.32, 0.08)
"""Positions of the first and the last recording of a group, relative to the position of the group,
as fractions of the distance between two groups."""
MEAN = 0.3
"""Position of the mean of a group, relative to the position of the group."""
MARGIN = 0.8
"""Width of the numbers and the label of the vertical axis [in]."""
LONGEST_LEVEL = 24
"""Number of characters to which the name of a level is shortened."""
DRAWN = {one.symbol: one for one in (STIFFNESS, DAMPING)}
OTHER_KIND = f"recording, b {BESIDES_RELAXATION} (of the others: {LOSS})"
"""Text in the legend for recordings whose b is another physical quantity than b of the others."""


class Place(NamedTuple):
    """A group of recordings, with the place of the group in the figure."""

    row: str
    """Level of the row of panels; empty if the figure has no such rows."""
    name: tuple[str, ...]
    """Levels of the other factors, which are written below the axis."""
    means: dict[str, Mean]
    """Means of k and b of the group, by symbol."""
    results: list[StiffnessResult]
    """Results of the recordings of the group. Recordings without a result are left out."""
    other: list[bool]
    """Whether b of each of these results is of the kind `BESIDES_RELAXATION`, while b of others in
    the figure is another physical quantity."""

    def intervals(self, symbol: str) -> list[Interval]:
        """Return the 95 % intervals of k or b that are drawn for this group."""
        mean, shown = self.means[symbol], DRAWN[symbol].shown
        found = [result.interval(symbol) for result in self.results if result.determines(symbol)]
        if mean.recordings > 1:
            found.append((mean.value - mean.half, mean.value + mean.half))
        return [(shown(low), shown(high)) for low, high in found]


def comparison_figure(
    rows: Sequence[Compared], groups: Sequence[Group], by: Sequence[str]
) -> Figure:
    """Return a figure of k and b of each recording, and of the mean of each group.

    Error bars are 95 % intervals. If k or b of the groups differ too much for one linear axis
    (`comparison_scales.WIDE`), the groups are divided between several rows of panels, one row for
    each level of a factor.
    """
    places, factor = placed(rows, groups, by)
    names = list(dict.fromkeys(place.name for place in places))
    levels = list(dict.fromkeys(place.row for place in places))
    if factor is None:
        figure = new_figure(0.75, rows=2)
        columns = [[axes] for axes in figure.subplots(2, 1, sharex=True)]
    else:
        figure = new_figure(0.75, rows=len(levels))
        panels = figure.subplots(len(levels), 2, sharex=True, squeeze=False)
        columns = [list(column) for column in panels.T]
    for (symbol, quantity), column in zip(DRAWN.items(), columns, strict=True):
        for axes, level in zip(column, levels, strict=True):
            shown = [place for place in places if place.row == level]
            draw_panel(axes, shown, names, symbol)
        if factor is None:
            column[0].set_ylabel(quantity.label)
        else:
            column[0].set_title(quantity.label, fontsize="medium")
    if factor is not None:
        for axes, level in zip(columns[0], levels, strict=True):
            axes.set_ylabel(f"{plain(by[factor])}: {level_text(level)}")
        figure.align_ylabels(columns[0])
    below = [columns[-1][-1]] if factor is None else [column[-1] for column in columns]
    for axes in below:
        label_groups(axes, names, figure.get_figwidth() / len(below))
        if others := [name for i, name in enumerate(by) if i != factor]:
            axes.set_xlabel(plain(", ".join(others)))
    common_legend(figure, figure.axes)
    return figure


def placed(
    rows: Sequence[Compared], groups: Sequence[Group], by: Sequence[str]
) -> tuple[list[Place], int | None]:
    """Return the place of each group, and the index of the factor that divides the figure."""
    results = [
        [r.result for r in rows if r.levels(by) == group.levels and r.result.identifiable]
        for group in groups
    ]
    mixed = len({result.kinds["b"] for found in results for result in found}) > 1
    places = [
        Place(
            "",
            group.levels,
            group.means[RESULT],
            found,
            [mixed and result.kinds["b"] == BESIDES_RELAXATION for result in found],
        )
        for group, found in zip(groups, results, strict=True)
    ]
    factor = factor_of_rows(
        {place.name: [place.intervals(symbol) for symbol in DRAWN] for place in places}
    )
    if factor is not None:
        places = [
            place._replace(
                row=place.name[factor], name=place.name[:factor] + place.name[factor + 1 :]
            )
            for place in places
        ]
    return places, factor


def draw_panel(
    axes: Axes, places: Iterable[Place], names: Sequence[tuple[str, ...]], symbol: str
) -> None:
    """Draw k or b of several groups of recordings in one panel."""
    intervals: list[Interval] = []
    for place in places:
        at = names.index(place.name)
        draw_results(axes, at, place, symbol)
        draw_mean(axes, at, place.means[symbol], DRAWN[symbol].factor)
        intervals += place.intervals(symbol)
    set_scale(axes, [pair for pair in intervals if all(map(math.isfinite, pair))])
    tidy(axes, "y")


def label_groups(axes: Axes, names: Sequence[tuple[str, ...]], width: float) -> None:
    """Write the names of the groups below an axis of this width [inch]."""
    texts = ["\n".join(map(level_text, name)) for name in names]
    name_ticks(axes, range(len(names)), texts, width - MARGIN)
    axes.set_xlim(-0.6, len(names) - 0.4)


def level_text(level: str) -> str:
    """Return a level as text for the figure, shortened to `LONGEST_LEVEL` characters."""
    return plain(level[:LONGEST_LEVEL])


def draw_results(axes: Axes, at: int, place: Place, symbol: str) -> None:
    """Draw k or b of each recording of a group with 95 % intervals, or "no result"."""
    shown = np.array([one.determines(symbol) for one in place.results], bool)
    if not shown.any():
        axes.text(
            at,
            0.03,
            "no result",
            transform=axes.get_xaxis_transform(),
            color="#595959",
            ha="center",
            va="bottom",
            rotation=90,
        )
        return
    factor = DRAWN[symbol].factor
    value = np.array([getattr(one, symbol) for one in place.results], np.float64) * factor
    low, high = np.array([one.interval(symbol) for one in place.results], np.float64).T * factor
    positions = at + np.linspace(*RECORDINGS, len(value)) if len(value) > 1 else np.array([at])
    other = np.array(place.other) if symbol == "b" else np.zeros(len(value), bool)
    for part, face, text in (
        (shown & ~other, BLUE, "recording, 95 % interval"),
        (shown & other, "#ffffff", OTHER_KIND),
    ):
        if part.any():
            axes.errorbar(
                positions[part],
                value[part],
                [(value - low)[part], (high - value)[part]],
                fmt="o",
                color=BLUE,
                markerfacecolor=face,
                markersize=3.5,
                linewidth=0.8,
                capsize=2,
                label=text,
            )


def draw_mean(axes: Axes, place: int, mean: Mean, factor: float) -> None:
    """Draw the mean of k or b of a group, if it is the mean of at least two recordings."""
    if mean.recordings < 2:
        return
    axes.errorbar(
        place + MEAN,
        mean.value * factor,
        mean.half * factor,
        fmt="D",
        color="#000000",
        markersize=4.5,
        linewidth=1.4,
        capsize=4,
        label="mean, 95 % interval",
    )
