"""Draw the estimated stiffness in several trials, and the values of the reproduced paper."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from estimation import Estimates
from estimation.arrays import Floats
from estimation.figure_style import PROFILE, draw, legend, limits, line, new_figure, tidy
from estimation.figures import START, drawn
from estimation.quantities import STIFFNESS


def stiffness_figure(
    panels: Mapping[str, tuple[Floats, Mapping[str, Estimates]]],
    paper: Mapping[str, float],
    same_scale: bool = False,
) -> Figure:
    """Return a figure of the estimated stiffness in several trials, one panel for each trial.

    Parameters
    ----------
    panels
        Data of each trial, by the title of its panel: the time [s], shape (n,), and a mapping from
        the name of each estimator to its estimates.
    paper
        Average stiffness of each trial in the paper that this package reproduces [N/m], by the
        title of its panel. It is drawn as a horizontal line.
    same_scale
        Whether the stiffness axes of all panels have the same limits.
    """
    figure = new_figure(0.29 * len(panels) + 0.08, rows=len(panels))
    axes = figure.subplots(len(panels), 1, sharex=True, sharey=same_scale)
    everything = []
    factor, unit = STIFFNESS.axis(1e3)
    for row, (title, (t, estimates)) in zip(axes, panels.items(), strict=True):
        shown = {name: drawn(series, factor) for name, series in estimates.items()}
        for i, (name, one) in enumerate(shown.items()):
            draw(row, t, one.k, label=name, **line(i))
        level = paper[title] * factor
        row.axhline(level, color=PROFILE, linewidth=0.9, label="paper, average of rls")
        row.set_title(title, loc="left", fontsize="medium")
        row.set_ylabel(f"{STIFFNESS.hat} [{unit}]")
        later = t >= t[0] + START * (t[-1] - t[0])
        own = [one.k[later] for one in shown.values()]
        everything += own
        limits(row, everything if same_scale else own, (0.0, level))
        tidy(row)
        row.set_xlim(t[0], t[-1])
    if same_scale:
        limits(axes[0], everything, (0.0, *(level * factor for level in paper.values())))
    axes[-1].set_xlabel("time [s]")
    legend(figure, *axes[0].get_legend_handles_labels())
    return figure
