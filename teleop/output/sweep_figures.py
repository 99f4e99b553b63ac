"""Draw figures of a sweep: the effect of each factor on a result, and maps over two factors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.figure_style import CHOSEN, WIDTHS, legend, line, new_figure, tidy
from teleop.output.figure_files import plain

MOST_LEVELS = 12
"""Largest number of different values of a numerical factor that are shown separately. If there are
more values, they are divided into bins."""
BINS = 8
"""Number of bins of a factor. Each bin contains about the same number of rows of the sweep's
table."""
INCHES = 2.4
"""Smallest width of a panel [in]."""
CHARACTERS = 18
"""If the names of all levels in a panel have more characters in total, they are written
vertically."""


class Levels(NamedTuple):
    """Levels of a factor.

    Each level is one value of the factor, or one bin if the factor has many different numbers.
    """

    places: Floats
    """Position of each level on the axis, shape (levels,). For numbers, it is the value of the
    level, or the mean of the values in the bin. For texts, it is an index."""
    names: tuple[str, ...]
    """Name of each level if the values of the factor are texts; empty if they are numbers."""
    level: NDArray[np.intp]
    """Index of the level in each row of the sweep's table, shape (n,)."""


class SweepRows(NamedTuple):
    """The n rows of a sweep's table that contain the result to show in a figure.

    The table has a row for each estimator at each combination of settings. Each array has the shape
    (n,).
    """

    factors: dict[str, Sequence[float | str]]
    """Values of each factor in the n rows, by the name of the factor."""
    estimator: NDArray[np.str_]
    """Name of the estimator in each row."""
    response: Floats
    """The result that the figure shows, in each row."""
    heading: str
    """Name of the result with its unit."""


def levels_of(values: Sequence[float | str]) -> Levels:
    """Return the different values of a factor; more than `MOST_LEVELS` numbers are binned."""
    if any(isinstance(value, str) for value in values):
        names, index = np.unique([str(value) for value in values], return_inverse=True)
        order = dict.fromkeys(str(value) for value in values)
        rank = np.array([[*order].index(name) for name in names.tolist()])
        return Levels(np.arange(len(names), dtype=float), tuple(order), rank[index])
    numbers = np.array(values, dtype=float)
    places, index = np.unique(numbers, return_inverse=True)
    if len(places) <= MOST_LEVELS:
        return Levels(places, (), index)
    edges = np.quantile(numbers, np.linspace(0.0, 1.0, BINS + 1)[1:-1])
    index = np.searchsorted(edges, numbers, side="right")
    filled, index = np.unique(index, return_inverse=True)
    means = [float(np.mean(numbers[index == i])) for i in range(len(filled))]
    return Levels(np.array(means), (), index)


def main_effects_figure(rows: SweepRows) -> Figure:
    """Return the mean result at each level of each factor, with 95 % intervals of the mean."""
    columns = max(1, min(len(rows.factors), int(WIDTHS[CHOSEN.get()] / INCHES)))
    lines = -(-len(rows.factors) // columns)
    figure = new_figure(0.42 * lines, rows=lines)
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False)
    names = [*dict.fromkeys(rows.estimator.tolist())]
    for axes, (factor, values) in zip(panels.flat, rows.factors.items(), strict=False):
        levels = levels_of(values)
        for number, name in enumerate(names):
            draw_effect(axes, levels, rows.response, rows.estimator == name, name, number)
        label_axis(axes, factor, levels)
        tidy(axes)
    for axes in panels.flat[len(rows.factors) :]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel(plain(rows.heading))
    handles, texts = panels[0, 0].get_legend_handles_labels()
    legend(figure, handles, texts)
    return figure


def draw_effect(
    axes: Axes, levels: Levels, response: Floats, chosen: NDArray[np.bool_], name: str, number: int
) -> None:
    """Draw the mean result of one estimator at each level of a factor, with 95 % intervals."""
    places, means, halves = [], [], []
    for level, place in enumerate(levels.places.tolist()):
        values = response[chosen & (levels.level == level)]
        if len(values):
            spread = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
            places.append(place)
            means.append(float(np.mean(values)))
            halves.append(LEVEL_95 * spread / np.sqrt(len(values)))
    marker = "osD^v"[number % 5]
    style = line(number) | {"marker": marker, "markersize": 4, "markevery": None}
    axes.errorbar(places, means, halves, label=name, capsize=2, **style)


def label_axis(axes: Axes, factor: str, levels: Levels) -> None:
    """Label the axis of a factor with its name and levels, or make it logarithmic."""
    axes.set_xlabel(plain(factor))
    if levels.names:
        name_ticks(axes, levels.places, levels.names)
    elif is_logarithmic(levels.places):
        axes.set_xscale("log")


def name_ticks(axes: Axes, places: Floats, names: Sequence[str]) -> None:
    """Write the names of levels below the axis, long ones vertically."""
    axes.set_xticks(places.tolist(), [plain(name) for name in names])
    if sum(map(len, names)) > CHARACTERS:
        axes.tick_params(axis="x", labelrotation=90)


def is_logarithmic(places: Floats) -> bool:
    """Return whether positive increasing numbers are more evenly spaced as logarithms."""
    if len(places) < 3 or places[0] <= 0.0:
        return False
    even, even_logarithm = (np.diff(one) for one in (places, np.log(places)))
    return bool(np.ptp(even_logarithm) / even_logarithm.mean() < np.ptp(even) / even.mean())


def map_figure(rows: SweepRows, first: str, second: str) -> Figure:
    """Return a map of the mean result over two factors for each estimator."""
    across, upwards = levels_of(rows.factors[first]), levels_of(rows.factors[second])
    names = [*dict.fromkeys(rows.estimator.tolist())]
    columns = max(1, min(len(names), int(WIDTHS[CHOSEN.get()] / INCHES)))
    lines = -(-len(names) // columns)
    figure = new_figure(0.38 * lines, rows=lines)
    panels = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    maps = []
    for name in names:
        cells = np.full((len(upwards.places), len(across.places)), np.nan)
        for i, j in np.ndindex(cells.shape):
            chosen = (rows.estimator == name) & (upwards.level == i) & (across.level == j)
            if chosen.any():
                cells[i, j] = np.mean(rows.response[chosen])
        maps.append(cells)
    low, high = (float(end(maps)) for end in (np.nanmin, np.nanmax))
    image = None
    for axes, name, cells in zip(panels.flat, names, maps, strict=False):
        image = axes.imshow(cells, origin="lower", aspect="auto", vmin=low, vmax=high)
        axes.set_title(plain(name))
        columns_named, rows_named = (
            levels.names or [f"{place:.3g}" for place in levels.places]
            for levels in (across, upwards)
        )
        name_ticks(axes, np.arange(len(columns_named), dtype=float), columns_named)
        axes.set_yticks(range(len(rows_named)), [plain(name) for name in rows_named])
    for axes in panels[-1]:
        axes.set_xlabel(plain(first))
    for axes in panels[:, 0]:
        axes.set_ylabel(plain(second))
    for axes in panels.flat[len(names) :]:
        axes.set_visible(False)
    if image:
        figure.colorbar(image, ax=panels, label=plain(rows.heading))
    return figure
