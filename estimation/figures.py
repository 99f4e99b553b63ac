"""Draw the estimates of one or several estimators over time.

Displacement and velocity are drawn behind the estimates of at most five estimators. If there are
more estimators, each estimator has its own panels, without displacement and velocity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from estimation.arrays import Floats
from estimation.batch_fit import Fit
from estimation.conditioning import Regression
from estimation.estimator import LEVEL_95, Estimates
from estimation.figure_style import (
    BLUE,
    GREY,
    LINES,
    NO_ESTIMATE,
    ORANGE,
    PROFILE,
    PURPLE,
    characters,
    draw,
    explain,
    extremes,
    is_narrow,
    legend,
    limits,
    line,
    new_figure,
    shade,
    tidy,
)
from estimation.metrics import predicted_force
from estimation.misfit import LARGEST_MISFIT
from estimation.quantities import DAMPING, POSITION, STIFFNESS, VELOCITY
from estimation.stiffening import Interval

TOGETHER = len(LINES)
"""Largest number of estimators in one panel. If there are more, each has its own panels."""
START = 0.1
"""Fraction of the duration, at its start, that is not used to compute the limits of an axis."""
TRUTH: dict[str, Any] = {
    "color": "#444444",
    "linewidth": 0.9,
    "linestyle": (0, (10, 3)),
    "zorder": 1.9,
}
"""Style of the lines at the true values of a simulated specimen."""
RESULT: dict[str, Any] = {"color": PURPLE, "linewidth": 1.4, "zorder": 1.8}
"""Style of the lines at the result of all samples."""
INTERVALS = "95 % intervals"
"""Text in the legend for the shaded intervals."""
MOTION: dict[str, Any] = {"color": PROFILE, "linewidth": 0.7, "alpha": 0.55}
"""Style of the lines of displacement and velocity."""


class Truth(NamedTuple):
    """True damping and true stiffness of a simulated specimen."""

    b: float
    """Damping [N s/m]."""
    k_surface: float
    """Stiffness at the surface [N/m]."""
    k_deepest: float
    """Secant stiffness at the greatest depth [N/m]."""


class Result(NamedTuple):
    """Stiffness and damping from all samples together, with their 95 % intervals.

    A value that is not determined is None.
    """

    k: Interval | None
    """Stiffness [N/m]."""
    b: Interval | None
    """Damping [N s/m]."""
    kind: str = "tangent"
    """Kind of the stiffness."""


class Drawn(NamedTuple):
    """Estimates of one estimator, in the form in which they are drawn.

    `k` and `b` are the estimated stiffness and damping. `k_half` and `b_half` are the half widths
    of their 95 % confidence intervals. Each array has the shape (n,). The stiffness is in the unit
    of its axis, for example kN/m. The values before the first estimate are NaN.
    """

    k: Floats
    k_half: Floats
    b: Floats
    b_half: Floats

    @property
    def exists(self) -> bool:
        """Whether the estimator has computed an estimate at any of the samples."""
        return bool(np.isfinite(self.k).any())


class Levels(NamedTuple):
    """Values that do not depend on time, which are drawn as horizontal lines.

    They are in the units of the axes.
    """

    truth: Truth | None
    result: Result | None

    def draw(self, panels: tuple[Axes, Axes] | np.ndarray) -> None:
        """Draw the levels of the stiffness in the first panel, those of the damping in the second.

        The true values of the stiffness are those at the surface and at the greatest depth.
        """
        if truth := self.truth:
            for level in {truth.k_surface, truth.k_deepest}:
                panels[0].axhline(level, **TRUTH)
            panels[1].axhline(truth.b, **TRUTH)
        for axes, one in zip(panels, self.result[:2] if self.result else (), strict=False):
            if one:
                axes.axhspan(one.low, one.high, color=PURPLE, alpha=0.25, linewidth=0.0)
                axes.axhline(one.value, **RESULT)

    def entries(self) -> list[tuple[Line2D, str]]:
        """Return the lines and texts of the levels in the legend."""
        found = []
        if self.result and any(self.result[:2]):
            name = f"result (k: {self.result.kind})"
            found.append((Line2D([], [], **RESULT), name))
        if self.truth:
            found.append((Line2D([], [], **TRUTH), "true values (k: secants)"))
        return found

    def values(self) -> tuple[list[float], list[float]]:
        """Return the levels that must be within the limits of the two panels."""
        k, b = ([*(one or ())] for one in (self.result[:2] if self.result else (None, None)))
        if truth := self.truth:
            k += [truth.k_surface, truth.k_deepest]
            b.append(truth.b)
        return [0.0, *k], b


def estimates_figure(
    title: str,
    t: Floats,
    x: Floats,
    v: Floats,
    estimates: Mapping[str, Estimates],
    truth: Truth | None = None,
    result: Result | None = None,
    remark: str = "",
) -> Figure:
    """Return a figure of the estimated stiffness, the estimated damping and the motion over time.

    If there are more than five estimators, each has its own panels, and the motion is not drawn.
    `result` is drawn as horizontal lines. `remark` is a text below the title.
    """
    scale, unit = k_scale(estimates)
    shown = {name: drawn(series, scale) for name, series in estimates.items()}
    labels = (
        f"{STIFFNESS.name} {STIFFNESS.hat} [{unit}]",
        f"{DAMPING.name} {DAMPING.hat} [{DAMPING.unit}]",
    )
    levels = Levels(scaled(truth, scale), scaled_result(result, scale))
    title = "\n".join(filter(None, (title, fill(remark, characters()))))
    if len(shown) > TOGETHER and any(one.exists for one in shown.values()):
        return small_multiples(title, t, shown, labels, levels)
    figure = new_figure(0.75, rows=2)
    panels = figure.subplots(2, 1, sharex=True)
    for i, (name, one) in enumerate(shown.items()):
        if one.exists:
            draw(panels[0], t, one.k, label=name, **line(i))
            draw(panels[1], t, one.b, **line(i))
    missing = [name for name, one in shown.items() if not one.exists]
    if len(missing) == len(shown):
        for axes in panels:
            explain(axes, NO_ESTIMATE)
            axes.set_yticks([])
    panels[0].set_title(title, loc="left", fontsize="medium")
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
    handles, names = panels[0].get_legend_handles_labels()
    if any(np.isfinite(one.k_half).any() for one in shown.values()):
        handles.append(Patch(facecolor=GREY, alpha=0.25))
        names.append(INTERVALS)
    handles.append(Line2D([], [], **MOTION))
    names.append("motion (right axis)")
    if 0 < len(missing) < len(shown):
        handles.append(Line2D([], [], linestyle="none"))
        names.append(f"no estimate: {', '.join(missing)}")
    levels.draw(panels)
    for handle, name in levels.entries():
        handles.append(handle)
        names.append(name)
    frame(panels, t, shown, levels)
    for i, one in enumerate(shown.values()):
        interval(panels[0], t, one.k, one.k_half, line(i)["color"])
        interval(panels[1], t, one.b, one.b_half, line(i)["color"])
    panels[1].set_xlabel("time [s]")
    panels[1].set_xlim(t[0], t[-1])
    profile(panels[0], t, x * POSITION.factor, f"displacement [{POSITION.unit}]")
    profile(panels[1], t, v * VELOCITY.factor, VELOCITY.heading)
    legend(figure, handles, names)
    return figure


def small_multiples(
    title: str,
    t: Floats,
    shown: Mapping[str, Drawn],
    labels: tuple[str, str],
    levels: Levels,
) -> Figure:
    """Return a figure with two panels for each estimator: stiffness and damping over time.

    All panels of the stiffness have the same limits, and so have all panels of the damping.
    """
    pairs = 1 if is_narrow() else 2
    rows = -(-len(shown) // pairs)
    figure = new_figure(0.1, rows=rows)
    figure.set_figheight(0.72 * rows + 0.9)
    panels = figure.subplots(rows, 2 * pairs, sharex=True, squeeze=False)
    columns = {
        quantity: [panels[i % rows, 2 * (i // rows) + q] for i in range(len(shown))]
        for q, quantity in enumerate(("k", "b"))
    }
    for quantity, label in zip(columns, labels, strict=True):
        for axes in columns[quantity][1:]:
            axes.sharey(columns[quantity][0])
        for axes in panels[0, (quantity == "b") :: 2]:
            axes.set_title(label, loc="left", fontsize="medium")
    for (name, one), k_axes, b_axes in zip(shown.items(), columns["k"], columns["b"], strict=True):
        for axes, values in ((k_axes, one.k), (b_axes, one.b)):
            draw(axes, t, values, color="#000000", linewidth=0.9)
            if not one.exists:
                explain(axes, "no estimate")
        k_axes.annotate(
            name,
            (0.98, 0.08),
            xycoords="axes fraction",
            ha="right",
            fontsize="small",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8},
        )
        levels.draw((k_axes, b_axes))
    frame((columns["k"][0], columns["b"][0]), t, shown, levels)
    for one, k_axes, b_axes in zip(shown.values(), columns["k"], columns["b"], strict=True):
        interval(k_axes, t, one.k, one.k_half, BLUE)
        interval(b_axes, t, one.b, one.b_half, BLUE)
    for column in panels.T:
        used = [axes for axes in column if axes.has_data()]
        for axes in used:
            tidy(axes)
            axes.tick_params(labelbottom=axes is used[-1])
        used[-1].set_xlabel("time [s]")
        for axes in column[len(used) :]:
            axes.set_visible(False)
    panels[0, 0].set_xlim(t[0], t[-1])
    handles = [Line2D([], [], color="#000000", linewidth=0.9), Patch(facecolor=BLUE, alpha=0.25)]
    names = ["estimate", INTERVALS]
    for handle, name in levels.entries():
        handles.append(handle)
        names.append(name)
    figure.suptitle(title, x=0.01, ha="left", fontsize="medium")
    legend(figure, handles, names, "lower")
    return figure


def drawn(series: Estimates, scale: float) -> Drawn:
    """Return the estimates of one estimator for a figure. `scale` multiplies the stiffness."""
    unknown = np.logical_and.accumulate(series.held)
    k, b = (np.where(unknown, np.nan, values) for values in (series.k, series.b))
    k_half, b_half = (
        np.where(unknown | ~np.isfinite(std), np.nan, LEVEL_95 * std)
        for std in (series.k_std, series.b_std)
    )
    return Drawn(k * scale, k_half * scale, b * DAMPING.factor, b_half * DAMPING.factor)


def k_scale(estimates: Mapping[str, Estimates]) -> tuple[float, str]:
    """Return the factor from N/m to the unit of the stiffness axis, and this unit."""
    largest = max(float(np.median(np.abs(series.k))) for series in estimates.values())
    return STIFFNESS.axis(largest)


def scaled(truth: Truth | None, scale: float) -> Truth | None:
    """Return the true values in the units of the axes."""
    return truth and Truth(DAMPING.shown(truth.b), truth.k_surface * scale, truth.k_deepest * scale)


def scaled_result(result: Result | None, scale: float) -> Result | None:
    """Return the result in the units of the axes."""
    if result is None:
        return None
    k, b = (
        one and Interval(*(factor * value for value in one))
        for one, factor in ((result.k, scale), (result.b, DAMPING.factor))
    )
    return Result(k, b, result.kind)


def frame(
    panels: tuple[Axes, Axes] | np.ndarray,
    t: Floats,
    shown: Mapping[str, Drawn],
    levels: Levels,
) -> None:
    """Set the vertical limits and the style of the panels of stiffness and damping.

    The limits are computed from the estimates, their intervals and the levels. The estimates in the
    first 10 % of the time are ignored, because an estimator may not have converged yet.
    """
    later = t >= t[0] + START * (t[-1] - t[0])
    k_levels, b_levels = levels.values()
    k = [end for one in shown.values() for end in shown_ends(one.k[later], one.k_half[later])]
    b = [end for one in shown.values() for end in shown_ends(one.b[later], one.b_half[later])]
    limits(panels[0], k, k_levels)
    limits(panels[1], b, b_levels)
    for axes in panels:
        tidy(axes)


def shown_ends(values: Floats, half: Floats) -> list[Floats]:
    """Return the lines that must be within a panel: the estimates, and their median interval.

    The interval is left out if its median half width is larger than the median estimate.
    """
    known = half[np.isfinite(half)]
    if not len(known) or np.median(known) > np.median(np.abs(values[np.isfinite(values)])):
        return [values]
    return [values, values - np.median(known), values + np.median(known)]


def interval(axes: Axes, t: Floats, values: Floats, half: Floats, colour: str) -> None:
    """Shade the 95 % confidence interval of an estimate, where an end of it is within the panel."""
    low, high = values - half, values + half
    bottom, top = axes.get_ylim()
    wide = (low < bottom) & (high > top)
    low, high = np.where(wide, np.nan, low), np.where(wide, np.nan, high)
    shade(axes, t, low, high, color=colour, alpha=0.15)


def profile(axes: Axes, t: Floats, values: Floats, label: str) -> None:
    """Draw displacement or velocity as a thin grey line on a second axis, behind the estimates."""
    twin = axes.twinx()
    draw(twin, t, values, **MOTION)
    twin.set_ylabel(label, color=PROFILE)
    twin.tick_params(axis="y", colors=PROFILE)
    twin.spines["top"].set_visible(False)
    axes.set_zorder(twin.get_zorder() + 1)
    axes.patch.set_visible(False)


def known_truth(values: Mapping[str, float] | None) -> Truth | None:
    """Return the true damping and stiffness of a trial; None if one of them is not known.

    `values` contains the true values by name. The names are those of the fields of `Truth`, and a
    value that is not known is NaN. If no value is known, `values` may be None or empty.
    """
    if not values or not all(math.isfinite(values[name]) for name in Truth._fields):
        return None
    return Truth(*(values[name] for name in Truth._fields))


def misfit_remark(misfit: Mapping[str, float]) -> str:
    """Return which estimators have a large misfit, from the misfits by name; empty if none has."""
    large = [
        f"{name} {one:.{0 if one >= 0.1 else 1}%}"
        for name, one in misfit.items()
        if one > LARGEST_MISFIT
    ]
    if not large:
        return ""
    return f"misfit above {LARGEST_MISFIT:.0%}, estimates cannot be used: {', '.join(large)}"


MEASURED: dict[str, Any] = {"color": "#000000", "linewidth": 0.9}
PREDICTED: dict[str, Any] = {"color": ORANGE, "linewidth": 2.4, "alpha": 0.55}
MODEL: dict[str, Any] = {"color": ORANGE, "alpha": 0.35, "linewidth": 1.0}
LEAST_SQUARES = "least squares of the model"
RANGES = 200
"""Number of intervals of displacement for which the range of the fitted force is drawn."""


def force_figure(
    title: str, t: Floats, regression: Regression, name: str, estimates: Estimates, fit: Fit
) -> Figure:
    """Return a figure of the measured force and the predicted force, with three panels.

    The first panel shows the force over time, measured and predicted by an online estimator. The
    second panel shows the error of this prediction. The third panel shows the force over
    displacement: measured, and the range of the force that a least-squares fit to all samples gives
    at each displacement.

    Each sample of the force is predicted with the estimate after the previous sample. If all values
    of the fit are NaN, no fit is drawn.
    """
    figure = new_figure(0.95, rows=3)
    grid = figure.add_gridspec(3, 1, height_ratios=(2.0, 1.0, 2.5))
    over_t, error, over_x = (figure.add_subplot(grid[i]) for i in range(3))
    error.sharex(over_t)
    x, f = regression.x * POSITION.factor, regression.f
    predicted = predicted_force(regression, estimates)
    predicted = np.where(np.logical_and.accumulate(estimates.held), np.nan, predicted)
    if np.isfinite(predicted).any():
        draw(over_t, t, predicted, label=f"predicted by {name}", **PREDICTED)
        draw(error, t, f - predicted, color=ORANGE, linewidth=0.6)
    else:
        explain(error, f"{name}: {NO_ESTIMATE}")
        error.set_yticks([])
    draw(over_t, t, f, label="measured", **MEASURED)
    shown = extremes(f)
    if np.isfinite(fit.residual).any():
        place, low, high = force_range(x, f - fit.residual)
        over_x.fill_between(place, low, high, label=LEAST_SQUARES, **MODEL)
    over_x.plot(x[shown], f[shown], label="measured", **MEASURED)
    over_t.set_title(title, loc="left")
    over_t.set_ylabel("force [N]")
    over_t.tick_params(labelbottom=False)
    error.set_ylabel("error [N]")
    error.set_xlabel("time [s]")
    over_t.set_xlim(t[0], t[-1])
    over_x.set_xlabel(f"displacement [{POSITION.unit}]")
    over_x.set_ylabel("force [N]")
    limits(over_t, [np.repeat((f.min(), f.max()), 50)])
    limits(error, [f - predicted], (0.0,))
    for axes in (over_t, error, over_x):
        tidy(axes)
    handles, names = over_t.get_legend_handles_labels()
    model, text = over_x.get_legend_handles_labels()
    legend(figure, [*handles, *model[:-1]], [*names, *text[:-1]])
    return figure


def force_range(x: Floats, f: Floats) -> tuple[Floats, Floats, Floats]:
    """Return displacements, and the smallest and the largest force near each of them."""
    edges = np.linspace(x.min(), x.max(), RANGES + 1)
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, RANGES - 1)
    low, high = np.full(RANGES, np.inf), np.full(RANGES, -np.inf)
    np.minimum.at(low, index, f)
    np.maximum.at(high, index, f)
    filled = low <= high
    return 0.5 * (edges[:-1] + edges[1:])[filled], low[filled], high[filled]
