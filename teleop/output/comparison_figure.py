"""Draw the stiffness and damping of several recordings, by group."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from estimation.figure_style import BLUE, legend, new_figure, tidy
from teleop.evaluation.comparison import RESULT, Compared, Group, Mean
from teleop.evaluation.result import Result
from teleop.output.figure_files import plain

SPREAD = 0.35
"""Width over which the recordings of a group are spread on the axis, as a fraction of the distance
between two groups."""
WIDE = 10.0
"""Ratio of the largest to the smallest stiffness above which the stiffness axis is logarithmic."""
CHARACTERS = 9.0
"""Largest number of characters per inch of width for which group names are written horizontally."""
LONGEST_LEVEL = 24
"""Number of characters to which the name of a level is shortened."""


def comparison_figure(
    rows: Sequence[Compared], groups: Sequence[Group], by: Sequence[str]
) -> Figure:
    """Return a figure of k and b of each recording, and of the mean of each group.

    Error bars are 95 % intervals.

    Parameters
    ----------
    rows
        The recordings.
    groups
        Groups of these recordings, with their means.
    by
        Names of the factors by which the recordings are grouped.
    """
    figure = new_figure(0.75, rows=2)
    panels = figure.subplots(2, 1, sharex=True)
    labels = {"k": "stiffness $k$ [N/m]", "b": "damping $b$ [N s/m]"}
    for axes, symbol in zip(panels, labels, strict=True):
        for place, group in enumerate(groups):
            members = [row.result for row in rows if row.levels(by) == group.levels]
            draw_results(axes, place, [one for one in members if one.identifiable], symbol)
            draw_mean(axes, place, group.means[RESULT][symbol])
        axes.set_ylabel(labels[symbol])
        tidy(axes, "y")
    names = ["\n".join(plain(level[:LONGEST_LEVEL]) for level in one.levels) for one in groups]
    stiffness = [one.result.k for one in rows if one.result.k is not None]
    if stiffness and 0.0 < WIDE * min(stiffness) < max(stiffness):
        panels[0].set_yscale("log", subs=(1, 2, 5))
        panels[0].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panels[0].yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        panels[0].yaxis.set_minor_formatter(NullFormatter())
    panels[-1].set_xticks(range(len(groups)), names or [""])
    longest = max((len(part) for name in names for part in name.split("\n")), default=0)
    if longest * len(groups) > CHARACTERS * figure.get_figwidth():
        panels[-1].tick_params(axis="x", labelrotation=90)
    panels[-1].set_xlim(-0.6, len(groups) - 0.4)
    if by:
        panels[-1].set_xlabel(plain(", ".join(by)))
    handles, texts = panels[0].get_legend_handles_labels()
    unique = dict(zip(texts, handles, strict=True))
    legend(figure, [*unique.values()], [*unique])
    return figure


def draw_results(axes: Axes, place: int, results: Sequence[Result], symbol: str) -> None:
    """Draw k or b (`symbol`) of the recordings of a group side by side, at `place` on the axis."""
    if not results:
        axes.text(
            place,
            0.03,
            "no result",
            transform=axes.get_xaxis_transform(),
            color="#595959",
            ha="center",
            va="bottom",
            rotation=90,
        )
        return
    value, low, high = (
        np.array([getattr(one, f"{symbol}{end}") for one in results])
        for end in ("", "_low", "_high")
    )
    offset = SPREAD * (np.arange(len(value)) / max(len(value) - 1, 1) - 0.5)
    axes.errorbar(
        place + offset if len(value) > 1 else [place],
        value,
        [value - low, high - value],
        fmt="o",
        color=BLUE,
        markersize=3.5,
        linewidth=0.8,
        capsize=2,
        label="recording, 95 % interval",
    )


def draw_mean(axes: Axes, place: int, mean: Mean) -> None:
    """Draw the mean of a group at `place` on the axis, if the group has at least two recordings."""
    if mean.recordings < 2:
        return
    axes.errorbar(
        place + 0.5 * SPREAD + 0.1,
        mean.value,
        mean.half,
        fmt="D",
        color="#000000",
        markersize=4.5,
        linewidth=1.4,
        capsize=4,
        label="mean, 95 % interval between recordings",
    )
