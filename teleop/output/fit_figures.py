"""Draw the results of the batch evaluation, which fits models to all samples of a file together.

The figures show the fitted force, the residual, the phases of the motion and the complex stiffness.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimation.arrays import Floats
from estimation.batch_models import BatchFit
from estimation.figure_style import (
    BLUE,
    GREY,
    ORANGE,
    PURPLE,
    characters,
    common_legend,
    explain,
    is_narrow,
    new_figure,
    tidy,
)
from estimation.figures import Result
from estimation.quantities import DAMPING, POSITION, STIFFNESS
from estimation.stiffening import Interval
from teleop.evaluation.batch import kinds
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.evaluation import Evaluation
from teleop.output.figure_files import plain
from teleop.output.result_tables import with_interval

PHASE_COLOURS = {
    "free": "#BBBBBB",
    "loading": BLUE,
    "hold": "#E69F00",
    "unloading": "#009E73",
}
"""Colours of the phases of a palpation (palette of Okabe and Ito)."""
PHASE_LINES: dict[str, dict[str, Any]] = {
    "free": {"linewidth": 1.0},
    "loading": {"linewidth": 2.0, "alpha": 0.7},
    "hold": {"linewidth": 1.0, "linestyle": "", "marker": ".", "markersize": 3.0},
    "unloading": {"linewidth": 1.2, "linestyle": (0, (5, 1.5))},
}
"""Line width, dashes and markers of each phase, so that the phases also differ without colours."""
ENDS = ("_low", "_high")
"""Endings of the names of the ends of an interval in a result."""
MODEL = "#000000"
TANGENT = 0.15
"""Half of the width of the drawn tangent, as a fraction of the travel in contact."""
MOST_POINTS = 4000
"""Approximate largest number of samples that are drawn in a line."""


def fit_figure(title: str, evaluation: Evaluation) -> Figure:
    """Return a figure of the force in a file, the force of the best model, and the residual.

    The upper panel shows the force against displacement, the middle panel the force against time.
    The lower panel shows the residual, which is the smoothed force minus the force of the model.

    Before a model is fitted, the baseline of the force is subtracted. The baseline is the part of
    the force that varies more slowly than the palpation. In the figure, the baseline is added to
    the force of the model, so that this force can be compared with the measured force.
    """
    record, datum = evaluation.analysis.record, evaluation.datum
    figure = new_figure(1.05, rows=3)
    grid = figure.add_gridspec(3, 1, height_ratios=(3.0, 2.0, 1.0))
    over_x, over_t, residual = (figure.add_subplot(grid[i]) for i in range(3))
    residual.sharex(over_t)
    fit = evaluation.best_model
    draw_depths(over_x, evaluation, drawn_name(evaluation, fit) if fit else "")
    every = thinning(record)
    f, t = record.raw_f - datum.f, record.t
    measured = f.copy()
    for start in record.starts[1:]:
        measured[start : start + every] = np.nan  # no line over a gap
    over_t.plot(
        t[::every], measured[::every], color=GREY, linewidth=2.0, alpha=0.5, label="measured"
    )
    for phase in evaluation.analysis.phases.phases:
        over_t.axvspan(
            t[phase.start], t[phase.end - 1], color=PHASE_COLOURS[phase.name], alpha=0.10, lw=0
        )
    if fit is not None:
        force = force_of(fit, evaluation)
        over_t.plot(t[::every], force[::every], color=MODEL, linewidth=0.6)
        left = record.f - datum.f - force
        residual.plot(t[::every], left[::every], color=MODEL, linewidth=0.6)
    else:
        explain(residual, fill(f"no model: {first_reason(evaluation)}", characters()))
        residual.set_yticks([])
    over_x.set_title(plain(title), loc="left")
    over_t.set_ylabel(fill("force from the datum [N]", 15 if is_narrow() else 90))
    over_t.tick_params(labelbottom=False)
    residual.set_ylabel("residual [N]")
    residual.set_xlabel("time [s]")
    residual.axhline(0.0, color="#888888", linewidth=0.6)
    over_t.set_xlim(t[0], t[-1])
    for axes in (over_t, residual):
        tidy(axes)
    common_legend(figure, (over_t, over_x))
    return figure


def depth_figure(evaluation: Evaluation) -> Figure:
    """Return a figure of the force against displacement: measured, best model, and tangent k."""
    figure = new_figure(0.62)
    axes = figure.subplots()
    draw_depths(axes, evaluation, fit.name if (fit := evaluation.best_model) else "")
    if not evaluation.analysis.result.identifiable:
        explain(axes, fill(f"no stiffness: {first_reason(evaluation)}", characters() - 12))
    common_legend(figure, [axes])
    return figure


def draw_depths(axes: Axes, evaluation: Evaluation, name: str) -> None:
    """Draw the force against displacement: measured, of the best model, and the tangent k.

    `name` is the name of the best model in the legend.
    """
    record, datum = evaluation.analysis.record, evaluation.datum
    every = thinning(record)
    x, f = (record.x - datum.x) * POSITION.factor, record.f - datum.f
    draw_phases(axes, evaluation, x, f, every)
    if (fit := evaluation.best_model) is not None:
        force = force_of(fit, evaluation)
        axes.plot(x[::every], force[::every], color=MODEL, linewidth=0.8, label=name)
    draw_tangent(axes, evaluation)
    axes.set_xlabel("displacement from the datum [mm]")
    axes.set_ylabel(fill("force from the datum [N]", 15 if is_narrow() else 90))
    tidy(axes)


def draw_tangent(axes: Axes, evaluation: Evaluation) -> None:
    """Draw the stiffness of the result as a tangent, at the force at which it is stated."""
    result, record = evaluation.analysis.result, evaluation.analysis.record
    if result.k is None or result.position is None:
        return
    loading = np.zeros(len(record.x), bool)
    for phase in evaluation.analysis.phases.phases:
        loading[phase.start : phase.end] = phase.name == "loading"
    distances = np.where(loading, np.abs(record.x - result.position), np.inf)
    force = record.f[distances.argmin()] - evaluation.datum.f
    part = TANGENT * np.ptp(record.x[evaluation.analysis.phases.usable]) * np.array((-1.0, 1.0))
    x = result.position - evaluation.datum.x
    axes.plot(
        (x + part) * POSITION.factor,
        force + result.k * part,
        color=PURPLE,
        linewidth=2.4,
        solid_capstyle="butt",
        label="tangent with slope k",
    )
    axes.plot(x * POSITION.factor, force, "o", color=PURPLE, markersize=6.0)


def drawn_result(result: Mapping[str, Any]) -> Result:
    """Return k and b of a result, to be drawn beside estimates."""
    k, b = (
        None if result[one] is None else Interval(*(result[one + end] for end in ("", *ENDS)))
        for one in (STIFFNESS.symbol, DAMPING.symbol)
    )
    return Result(k, b, kinds.TANGENT if result["storage_at_hz"] is None else kinds.STORAGE)


def result_title(title: str, result: Mapping[str, Any]) -> str:
    """Return the title of a figure, and below it k and b of the result with their intervals."""
    if not result["identifiable"]:
        reason = fill(f"no k and b: {result['reasons'][0]}", characters())
        return f"{title}\n{reason}"
    texts = []
    for one in (STIFFNESS, DAMPING):
        if result[one.symbol] is not None:
            low, high = (result[one.symbol + end] for end in ENDS)
            shown = with_interval(one, low, result[one.symbol], high)
            texts.append(f"{one.symbol} = {shown}")
    if result["b_reason"]:
        texts.append("b cannot be used")
    together = ", ".join(texts)
    return "\n".join([title, *([together] if len(together) <= characters() else texts)])


def thinning(record: SmoothedRecord) -> int:
    """Return n, so that about `MOST_POINTS` samples are drawn if every n-th is drawn."""
    return max(1, len(record.t) // MOST_POINTS)


def force_of(fit: BatchFit, evaluation: Evaluation) -> Floats:
    """Return the force of a model with the baseline, relative to the datum [N], shape (n,)."""
    record = evaluation.analysis.record
    fitted = evaluation.analysis.data or record
    return np.asarray(fit.predicted + record.f - fitted.f, np.float64)


def first_reason(evaluation: Evaluation) -> str:
    """Return why no model with identifiable parameters is drawn."""
    return next(iter(evaluation.analysis.result.reasons), "no parameters are identifiable")


def drawn_name(evaluation: Evaluation, fit: BatchFit) -> str:
    """Return the name of the model that a figure shows, for the legend.

    The figure shows the best model whose parameters are all identifiable (determined by the data).
    Another model can fit better, but have parameters that are not identifiable. The text then also
    states the name of this other model, and why it is not drawn.
    """
    if fit is evaluation.models[0]:
        return fit.name
    name = f"{fit.name} ({evaluation.models[0].name}: not all parameters identifiable)"
    return fill(name, characters())


def draw_phases(
    axes: Axes, evaluation: Evaluation, x: np.ndarray, f: np.ndarray, every: int
) -> None:
    """Draw the smoothed force [N] against displacement [mm], with a line style for each phase.

    Every `every`-th sample is drawn, more in short phases.
    """
    labelled = set()
    for phase in evaluation.analysis.phases.phases:
        part = slice(phase.start, phase.end + 1, min(every, max(1, (phase.end - phase.start) // 8)))
        axes.plot(
            x[part],
            f[part],
            color=PHASE_COLOURS[phase.name],
            **PHASE_LINES[phase.name],
            label=None if phase.name in labelled else phase.name,
        )
        labelled.add(phase.name)


def complex_stiffness_figure(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Return a figure of the complex stiffness k' + i k'' against frequency, with 95 % intervals.

    The panels show the storage stiffness k', the loss stiffness k'', and tan delta = k'' / k'.
    """
    figure = new_figure(0.9, rows=3)
    panels = figure.subplots(3, 1, sharex=True)
    ordered = sorted(rows, key=lambda row: float(row["frequency_hz"]))
    frequency = [row["frequency_hz"] for row in ordered]
    # A larger unit only from 10 of it on, because k" is often ten times smaller than k'.
    scale, unit = STIFFNESS.axis(0.1 * ordered[0]["storage_n_per_m"])
    for axes, (name, ending, label, size, colour) in zip(
        panels,
        (
            ("storage", "_n_per_m", f"storage k\u2032 [{unit}]", scale, BLUE),
            ("loss", "_n_per_m", f"loss k\u2033 [{unit}]", scale, ORANGE),
            ("tan_delta", "", "tan \u03b4 = k\u2033 / k\u2032", 1.0, "#000000"),
        ),
        strict=True,
    ):
        axes.errorbar(
            frequency,
            [row[name + ending] * size for row in ordered],
            [row[f"{name}_interval{ending}"] * size for row in ordered],
            color=colour,
            marker="o",
            markersize=4,
            capsize=4,
            linewidth=0.8,
        )
        axes.set_ylabel(label)
        axes.margins(y=0.15)
    lower = panels[-1]
    lower.set_xlabel("frequency [Hz]")
    lower.set_xscale("log")
    lower.set_xticks(frequency, [f"{value:.3g}" for value in frequency])
    lower.minorticks_off()
    for axes in panels:
        tidy(axes)
    return figure
