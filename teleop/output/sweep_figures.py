"""Draw figures of a sweep: the effect of each factor on a result, and maps over two factors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray
from scipy.special import stdtrit

from estimation.arrays import Floats
from estimation.figure_style import (
    CHOSEN,
    FONTS,
    WIDTHS,
    common_legend,
    line,
    name_ticks,
    new_figure,
    tidy,
)
from teleop.output.comparison_scales import WIDE, set_scale
from teleop.output.figure_files import plain

MOST_LEVELS = 12
"""Largest number of different values of a numerical factor that are shown separately. If there are
more values, they are divided into bins."""
BINS = 8
"""Number of bins of a factor. Each bin contains about the same number of rows of the sweep's
table."""
INCHES = 2.4
"""Smallest width of a panel [in]."""
MARGIN = 0.5
"""Width of the numbers of a vertical axis and of the space between panels [in]."""
BAR = 1.7
"""Width of the scale of colours and of the names beside a map [in]."""
SHIFT = 7.0
"""Distance between the means of two estimators at the same level [pt]."""
SMALLEST = 5.0
"""Smallest size of a number in a map [pt]. Cells that need a smaller one have no numbers."""


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


class Means(NamedTuple):
    """Mean result at each level of a factor, with the ends of its 95 % interval, shape (levels,).

    The ends are NaN if the rows are not sufficient for an interval. All values of a level without
    rows are NaN.
    """

    mean: Floats
    low: Floats
    high: Floats

    def intervals(self) -> list[tuple[float, float]]:
        """Return the interval at each level that has rows; the mean alone if it is not known."""
        low, high = np.fmin(self.low, self.mean), np.fmax(self.high, self.mean)
        known = np.isfinite(self.mean)
        return [*zip(low[known].tolist(), high[known].tolist(), strict=True)]


def main_effects_figure(rows: SweepRows) -> Figure:
    """Return the mean result at each level of each factor, with 95 % intervals of the mean.

    The effects of the other factors are removed from the means and intervals (`level_means`). If
    positive results differ by more than a decade, the means are geometric means.
    """
    count = len(rows.factors)
    columns = max(1, min(count, int(WIDTHS[CHOSEN.get()] / INCHES)))
    lines = -(-count // columns)
    figure = new_figure(0.42 * lines, rows=lines)
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False)
    names = [*dict.fromkeys(rows.estimator.tolist())]
    levels = [levels_of(values) for values in rows.factors.values()]
    logarithmic = is_wide(rows.response)
    intervals: list[tuple[float, float]] = []
    for number, name in enumerate(names):
        chosen = rows.estimator == name
        parts = [one._replace(level=one.level[chosen]) for one in levels]
        found = level_means(rows.response[chosen], parts, logarithmic)
        for axes, one, means in zip(panels.flat, levels, found, strict=False):
            draw_effect(axes, one, means, name, number - 0.5 * (len(names) - 1))
            intervals += means.intervals()
    set_scale(panels[0, 0], intervals)
    set_limits(panels[0, 0], intervals)
    width = figure.get_figwidth() / columns - MARGIN
    for axes, factor, one in zip(panels.flat, rows.factors, levels, strict=False):
        label_axis(axes, factor, one, width)
        tidy(axes)
    for axes in panels.flat[count:]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel(plain(f"{kind_of_mean(logarithmic)} of {rows.heading}"))
    common_legend(figure, [panels[0, 0]])
    return figure


def set_limits(axes: Axes, intervals: Sequence[tuple[float, float]]) -> None:
    """Set the limits of the vertical axis to the ends of all intervals, with a margin."""
    ends = np.array(intervals).ravel()
    transform = axes.yaxis.get_transform()
    low, high = transform.transform((ends.min(), ends.max()))
    margin = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    axes.set_ylim(*transform.inverted().transform((low - margin, high + margin)))


def is_wide(response: Floats) -> bool:
    """Return whether results are positive and differ by more than a decade."""
    return bool(response.min() > 0.0 and response.max() > WIDE * response.min())


def kind_of_mean(logarithmic: bool) -> str:
    """Return the name of the means that a figure shows."""
    return "geometric mean" if logarithmic else "mean"


def level_means(response: Floats, factors: Sequence[Levels], logarithmic: bool) -> list[Means]:
    """Return the means of a result at the levels of each factor.

    A sum of the effects of all factors is fitted to the results, or to their logarithms. The mean
    at a level is the mean result plus the effect of this level. The interval is computed from the
    residuals, so that it does not contain the effects of the other factors. If the points of the
    sweep do not separate the factors, for example because two factors always change together, each
    factor is fitted alone.
    """
    values = np.log(response) if logarithmic else response
    found = []
    for group in [factors] if are_separable(factors) else [[one] for one in factors]:
        effects, residual, free = additive_fit(values, group)
        half = np.nan
        if free > 0:
            half = float(stdtrit(free, 0.975) * np.sqrt(residual @ residual / free))
        for one, effect in zip(group, effects, strict=True):
            count = np.bincount(one.level, minlength=len(one.places)).astype(float)
            count[count == 0.0] = np.nan
            mean = values.mean() + effect + 0.0 * count
            ends = (mean, mean - half / np.sqrt(count), mean + half / np.sqrt(count))
            found.append(Means(*(np.exp(end) if logarithmic else end for end in ends)))
    return found


def additive_fit(values: Floats, factors: Sequence[Levels]) -> tuple[list[Floats], Floats, int]:
    """Fit a sum of one effect for each factor to values by least squares.

    Return the effects of each factor, whose mean over the rows is zero, the residuals, and the
    degrees of freedom of the residuals.
    """
    centred = values - values.mean()
    sums = [np.bincount(one.level, centred, len(one.places)) for one in factors]
    matrix = cross_counts(factors)
    solution, _, rank, _ = np.linalg.lstsq(matrix, np.concatenate(sums), rcond=1e-9)
    ends = np.cumsum([len(one.places) for one in factors])
    effects, residual = np.split(solution, ends[:-1]), centred
    for i, one in enumerate(factors):
        effects[i] = effects[i] - effects[i][one.level].mean()
        residual = residual - effects[i][one.level]
    return effects, residual, len(values) - int(rank)


def cross_counts(factors: Sequence[Levels]) -> Floats:
    """Return how many rows have each pair of levels, of the same or of different factors."""
    return np.block(
        [
            [
                np.bincount(
                    one.level * len(other.places) + other.level,
                    minlength=len(one.places) * len(other.places),
                )
                .reshape(len(one.places), len(other.places))
                .astype(float)
                for other in factors
            ]
            for one in factors
        ]
    )


def are_separable(factors: Sequence[Levels]) -> bool:
    """Return whether the rows determine the effects of all factors together."""
    counts = cross_counts(factors)
    used = sum(len(np.unique(one.level)) for one in factors)
    return bool(np.linalg.matrix_rank(counts, rtol=1e-9) == used - len(factors) + 1)


def draw_effect(axes: Axes, levels: Levels, means: Means, name: str, shift: float) -> None:
    """Draw the means of one estimator; `shift` is its place beside the other estimators."""
    number = len(axes.containers)
    style = line(number) | {"marker": "osD^v"[number % 5], "markersize": 4.5, "markevery": None}
    if levels.names:
        style["linestyle"] = ""
    beside = ScaledTranslation(SHIFT * shift / 72.0, 0.0, axes.figure.dpi_scale_trans)
    axes.errorbar(
        levels.places,
        means.mean,
        (means.mean - means.low, means.high - means.mean),
        label=name,
        capsize=2.5,
        transform=axes.transData + beside,
        **style | {"linewidth": 1.2, "alpha": 1.0},
    )


def label_axis(axes: Axes, factor: str, levels: Levels, width: float) -> None:
    """Label the axis of a factor with its name and levels, or make it logarithmic."""
    axes.set_xlabel(plain(factor))
    if levels.names:
        name_ticks(axes, levels.places.tolist(), [plain(name) for name in levels.names], width)
        axes.set_xlim(-0.5, len(levels.places) - 0.5)
        return
    low, high = levels.places[0], levels.places[-1]
    if is_logarithmic(levels.places):
        axes.set_xscale("log")
        axes.minorticks_off()
        texts = [f"{place:.3g}" for place in levels.places]
        name_ticks(axes, levels.places.tolist(), texts, width)
        margin = (high / low) ** 0.1
        axes.set_xlim(low / margin, high * margin)
    else:
        margin = 0.1 * (high - low) or 1.0
        axes.set_xlim(low - margin, high + margin)


def is_logarithmic(places: Floats) -> bool:
    """Return whether positive increasing numbers are more evenly spaced as logarithms."""
    if len(places) < 3 or places[0] <= 0.0:
        return False
    even, even_logarithm = (np.diff(one) for one in (places, np.log(places)))
    return bool(np.ptp(even_logarithm) / even_logarithm.mean() < np.ptp(even) / even.mean())


def map_figure(rows: SweepRows, first: str, second: str) -> Figure:
    """Return a map of the mean result over two factors for each estimator, with its numbers.

    If positive results differ by more than a decade, the colours are logarithmic, and the means are
    geometric means.
    """
    across, upwards = levels_of(rows.factors[first]), levels_of(rows.factors[second])
    names = [*dict.fromkeys(rows.estimator.tolist())]
    columns = max(1, min(len(names), int(WIDTHS[CHOSEN.get()] / INCHES)))
    lines = -(-len(names) // columns)
    figure = new_figure(0.38 * lines, rows=lines)
    panels = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    logarithmic = is_wide(rows.response)
    values = np.log(rows.response) if logarithmic else rows.response
    maps = []
    for name in names:
        cells = np.full((len(upwards.places), len(across.places)), np.nan)
        for i, j in np.ndindex(cells.shape):
            chosen = (rows.estimator == name) & (upwards.level == i) & (across.level == j)
            if chosen.any():
                cells[i, j] = np.mean(values[chosen])
        maps.append(np.exp(cells) if logarithmic else cells)
    low, high = (float(end(maps)) for end in (np.nanmin, np.nanmax))
    scale = LogNorm(low, high) if logarithmic else Normalize(low, high)
    width = (figure.get_figwidth() - BAR) / columns - 0.2
    columns_named, rows_named = (
        [plain(name) for name in levels.names or [f"{place:.3g}" for place in levels.places]]
        for levels in (across, upwards)
    )
    image = None
    for axes, name, cells in zip(panels.flat, names, maps, strict=False):
        image = axes.imshow(cells, origin="lower", aspect="auto", norm=scale)
        write_numbers(axes, image, cells, width / len(columns_named))
        axes.set_title(plain(name))
        name_ticks(axes, range(len(columns_named)), columns_named, width)
        axes.set_yticks(range(len(rows_named)), rows_named)
    for axes in panels[-1]:
        axes.set_xlabel(plain(first))
    for axes in panels[:, 0]:
        axes.set_ylabel(plain(second))
    for axes in panels.flat[len(names) :]:
        axes.set_visible(False)
    if image:
        bar = figure.colorbar(image, ax=panels)
        bar.set_label(plain(f"{kind_of_mean(logarithmic)} of {rows.heading}"))
        if logarithmic:
            set_scale(bar.ax, [(low, low), (high, high)])
    return figure


def write_numbers(axes: Axes, image: AxesImage, cells: Floats, width: float) -> None:
    """Write the value of each cell into it, if it can be read in a cell of this width [in]."""
    texts = {
        place: f"{float(f'{cells[place]:.3g}'):.9g}"
        for place in np.ndindex(cells.shape)
        if np.isfinite(cells[place])
    }
    longest = max(map(len, texts.values()), default=1)
    size = min(0.9 * FONTS[CHOSEN.get()], 72.0 * width / (0.65 * (longest + 1)))
    if size < SMALLEST:
        return
    for (i, j), text in texts.items():
        red, green, blue, _ = image.cmap(image.norm(cells[i, j]))
        dark = 0.299 * red + 0.587 * green + 0.114 * blue < 0.5
        colour = "white" if dark else "black"
        axes.text(j, i, text, ha="center", va="center", fontsize=size, color=colour)
