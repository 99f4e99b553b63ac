"""Define the style of all figures, and draw lines of many samples in less time."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from contextvars import ContextVar
from io import BytesIO
from itertools import pairwise
from typing import Any, Literal

from telepalpation import needs

try:
    import matplotlib as mpl
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(needs("a figure", "matplotlib", "plot"), name=error.name) from error
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from estimation.arrays import Floats

WIDTHS: dict[str, float] = {"screen": 8.0, "single": 3.5, "double": 7.16, "a4": 6.3, "page": 5.2}
"""Width of a figure [in], by its name.

`single` and `double` are one and two columns of an IEEE paper. `a4` is the text width of A4 paper.
`page` is one of two columns of a report page, whose text is readable on a phone.
"""
FONTS: dict[str, float] = {"screen": 10.0, "single": 7.0, "double": 8.0, "a4": 9.0, "page": 9.0}
"""Size of the text [pt], by the name of the width."""
CHOSEN: ContextVar[str] = ContextVar("CHOSEN", default="screen")
"""Name of the present width of figures, a key of `WIDTHS`. `figure_style` sets it."""
NARROW = 5.0
"""A figure that is narrower than this width [in] has thinner lines and fewer columns of panels."""
LINES: tuple[dict[str, Any], ...] = (
    {"color": "#0072B2", "linewidth": 2.4, "alpha": 0.75},
    {"color": "#D55E00", "linewidth": 1.2, "marker": "o", "markevery": (0.02, 0.17)},
    {"color": "#000000", "linewidth": 1.0, "linestyle": (0, (4, 2))},
    {
        "color": "#009E73",
        "linewidth": 1.2,
        "linestyle": (0, (6, 1.5, 1, 1.5)),
        "marker": "^",
        "markevery": (0.08, 0.17),
    },
    {
        "color": "#CC79A7",
        "linewidth": 1.4,
        "linestyle": (0, (1, 1.2)),
        "marker": "s",
        "markevery": (0.14, 0.17),
    },
)
"""Line styles. They differ in colour (palette of Okabe and Ito), width, dashes and markers."""
MARKER_SIZE = 4.0
"""Size of the markers [pt]."""
BLUE, ORANGE, PURPLE, GREY, PROFILE = "#0072B2", "#D55E00", "#A8628A", "#555555", "#8C8C8C"
NO_ESTIMATE = "no estimate: no contact or no motion"
"""Text that is shown instead of the estimates if no estimator was updated."""
BINS = 1000
"""Number of bins into which the samples of a line are divided, see `extremes` and `shade`."""


class PageFigure(Figure):
    """A figure that can be saved in less time, and that notebooks can show.

    When `Figure.savefig` of matplotlib saves a figure with constrained layout, it draws the figure
    twice. The first drawing only serves to compute the layout. This class computes the layout
    without the first drawing. In addition, a notebook shows the figure even if matplotlib.pyplot
    was not imported.
    """

    def draw(self, renderer: RendererBase) -> None:
        """Draw the figure, or only compute its layout.

        With constrained layout, `savefig` calls this method twice. The first call only computes the
        layout. The second call draws the figure with this layout.
        """
        layout = self.get_layout_engine()
        if isinstance(layout, ConstrainedLayoutEngine) and self.canvas.is_saving():
            layout.execute(self)
        else:
            super().draw(renderer)

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png", dpi=100)
        return file.getvalue()


@contextlib.contextmanager
def figure_style(width: str = "screen") -> Iterator[None]:
    """Context manager that sets the width of figures, and the size of their text.

    `width` is `screen`, `single`, `double` or `a4` (`WIDTHS`).
    """
    font = FONTS[width]
    parameters: Any = {
        "font.size": font,
        "axes.titlesize": 1.1 * font,
        "legend.fontsize": 0.9 * font,
        "axes.linewidth": 0.8 if width == "screen" else 0.6,
    }
    token = CHOSEN.set(width)
    try:
        with mpl.rc_context(parameters):
            yield
    finally:
        CHOSEN.reset(token)


def new_figure(ratio: float, rows: int = 1) -> Figure:
    """Return an empty figure. Its width is that of the context manager `figure_style`.

    `ratio` is height / width. The figure is higher if a row of panels would be below 1.25 inch.
    """
    width = WIDTHS[CHOSEN.get()]
    height = max(ratio * width, 1.25 * rows + 1.0)
    return PageFigure(figsize=(width, height), layout="constrained")


def is_narrow() -> bool:
    """Return whether the present width of figures is less than 5 inches, see `figure_style`."""
    return WIDTHS[CHOSEN.get()] < NARROW


def characters() -> int:
    """Return the number of characters that fit into the width of a figure without its margins."""
    return int((WIDTHS[CHOSEN.get()] - 0.6) * 72.0 / (0.58 * FONTS[CHOSEN.get()]))


def line(index: int) -> dict[str, Any]:
    """Return the style of a line, as keyword arguments of `Axes.plot` of matplotlib.

    `index` is the number of the line, from 0. There are five styles, which repeat.
    """
    style, scale = LINES[index % len(LINES)], 0.65 if is_narrow() else 1.0
    return style | {"linewidth": style["linewidth"] * scale, "markersize": MARKER_SIZE * scale}


def draw(axes: Axes, t: Floats, values: Floats, **style: Any) -> None:
    """Draw a line of values over time t, both of shape (n,).

    If there are many samples, only the samples that `extremes` selects are drawn. `**style`
    contains options of `Axes.plot` of matplotlib.
    """
    shown = extremes(values)
    axes.plot(t[shown], values[shown], **style)


def shade(axes: Axes, t: Floats, low: Floats, high: Floats, **style: Any) -> None:
    """Fill the area between two lines.

    If there are more than 1000 samples, successive samples are combined in bins. In each bin, the
    area is drawn from the smallest `low` to the largest `high`.
    """
    size = -(-len(t) // BINS)
    if size > 1:
        starts = np.arange(0, len(t), size)
        with np.errstate(invalid="ignore"):
            low, high = np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts)
        t = t[starts]
    axes.fill_between(t, low, high, **{"linewidth": 0.0, **style})


def extremes(values: Floats) -> NDArray[np.int_]:
    """Return the indices of a few samples whose line looks like the line of all samples.

    The samples are divided into 1000 bins of successive samples. The first, the smallest and the
    largest sample of each bin are selected, and also the last of all samples.

    If there are at most 3000 samples, all indices are returned.
    """
    n = len(values)
    if n <= 3 * BINS:
        return np.arange(n)
    edges = np.linspace(0, n, BINS + 1).astype(int).tolist()
    known = np.isfinite(values)
    low, high = np.where(known, values, np.inf), np.where(known, values, -np.inf)
    kept = [*edges[:-1], n - 1]
    for start, end in pairwise(edges):
        if known[start:end].any():
            kept += (start + low[start:end].argmin(), start + high[start:end].argmax())
    return np.unique(kept)


def limits(axes: Axes, series: Sequence[Floats], levels: Sequence[float] = ()) -> None:
    """Set the limits of the vertical axis.

    The limits contain the 2nd to the 98th percentile of each line, and all given levels. A margin
    is added above and below.

    `levels` are further values that must be within the limits, for example true values.
    """
    parts = [one[np.isfinite(one)] for one in series]
    ends = [np.percentile(one, (2, 98)) for one in parts if len(one)]
    values = [*(float(end) for pair in ends for end in pair), *levels]
    if not values:
        return
    low, high = min(values), max(values)
    margin = 0.12 * (high - low) or 0.1 * abs(high) or 1.0
    axes.set_ylim(low - margin, high + margin)


def legend(
    figure: Figure,
    handles: Sequence[Any],
    names: Sequence[str],
    place: Literal["upper", "lower"] = "upper",
) -> None:
    """Draw the legend of a figure above or below all panels.

    The legend has as many columns as fit into the width of the figure, at most four.
    """
    font = 0.9 * FONTS[CHOSEN.get()]
    fits = [n for n in (4, 3, 2, 1) if columns_width(names, n, font) < figure.get_figwidth()]
    figure.legend(
        handles,
        names,
        loc="outside upper right" if place == "upper" else "outside lower right",
        ncols=fits[0] if fits else 1,
        frameon=False,
    )


def common_legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """Draw one legend above the panels. A name that occurs in several panels is listed once."""
    drawn = [axes.get_legend_handles_labels() for axes in panels]
    unique = {name: handle for pair in drawn for handle, name in zip(*pair, strict=True)}
    legend(figure, [*unique.values()], [*unique])


def columns_width(names: Sequence[str], columns: int, font: float) -> float:
    """Return the approximate width [in] of a legend with these names.

    `columns` is the number of columns, and `font` is the size of the text [pt].
    """
    parts = np.array_split(np.array([len(name) for name in names]), min(columns, len(names)))
    longest = [int(part.max()) for part in parts]
    return sum(0.62 * length + 5.0 for length in longest) * font / 72.0


def name_ticks(axes: Axes, places: Sequence[float], names: Sequence[str], width: float) -> None:
    """Write names below an axis that is `width` [in] wide, at the given places.

    If they do not fit side by side, each name is lower than the one before, up to three lines. If
    this is not sufficient, the names are slanted.
    """
    lines = [name.split("\n") for name in names]
    longest = max((len(part) for name in lines for part in name), default=0)
    needed = (0.6 * longest + 1.0) * FONTS[CHOSEN.get()] / 72.0 * len(names)
    levels = next((n for n in (1, 2, 3) if needed < n * width), 0)
    height = max(map(len, lines), default=0)
    if levels:
        shown = ["\n" * (height * (i % levels)) + name for i, name in enumerate(names)]
        axes.set_xticks(places, shown)
    else:
        axes.set_xticks(places, names, rotation=30, ha="right", rotation_mode="anchor")


def explain(axes: Axes, text: str) -> None:
    """Write a text in the middle of a panel. The text explains why the panel has no line."""
    axes.text(
        0.5,
        0.5,
        text,
        transform=axes.transAxes,
        ha="center",
        va="center",
        fontsize="medium",
        color="#000000",
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 2.0},
    )


def tidy(axes: Axes, grid: Literal["both", "y"] = "both") -> None:
    """Draw a light grid in a panel, and remove its upper and right border.

    `grid` is `both`, or `y` for horizontal lines only.
    """
    axes.grid(axis=grid, alpha=0.25, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
