"""Draw figures of trials: fault, timing of the loop, tracking, felt force, estimates."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimation import Estimates
from estimation.arrays import Floats
from estimation.figure_style import (
    BLUE,
    ORANGE,
    PROFILE,
    characters,
    draw,
    legend,
    limits,
    line,
    new_figure,
    shade,
    tidy,
)
from estimation.figures import START, drawn
from estimation.quantities import DAMPING, FORCE, LATENESS, POSITION, STIFFNESS, VELOCITY
from estimation.redundancy import Ambiguity
from teleop.evaluation.teleoperation.rendering import RunningRendering
from teleop.evaluation.teleoperation.thresholds import NOTICEABLE
from teleop.output.figure_files import plain
from teleop.output.trial_tables import tracking_lines
from teleop.recording.recording import Recording

FREQUENCIES = (0.3, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0)
"""Marked frequencies in the figure of the impedance [Hz]."""


def fault_figure(recording: Recording, fault: Mapping[str, Any]) -> Figure:
    """Return the signals and commands shortly before and after a fault."""
    t = recording["time"]
    part = (t > fault["time"] - 0.5) & (t < fault["time"] + 0.5)
    ms = (t[part] - fault["time"]) * 1e3
    figure = new_figure(1.0, rows=4)
    rows = figure.subplots(4, 1, sharex=True)
    panels = (
        (FORCE, ("contact_force", "master_force")),
        (POSITION, ("slave_position", "master_position")),
        (
            VELOCITY,
            ("slave_velocity", "desired_slave_velocity", "applied_slave_velocity"),
        ),
        (LATENESS, ("lateness",)),
    )
    styles: tuple[dict[str, Any], ...] = (
        {"color": BLUE, "linewidth": 2.2, "alpha": 0.6},
        {"color": ORANGE, "linewidth": 1.2},
        {"color": "#000000", "linewidth": 1.0, "linestyle": (0, (4, 2))},
    )
    for axes, (quantity, names) in zip(rows, panels, strict=True):
        for name, style in zip(names, styles, strict=False):
            cause = " (fault)" if fault["source"] == name else ""
            values = recording[name][part] * quantity.factor
            draw(axes, ms, values, label=f"{name.replace('_', ' ')}{cause}", **style)
        axes.axvline(0.0, color="#CC0000", linewidth=1.0)
        axes.set_ylabel(quantity.heading)
        tidy(axes)
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=len(names),
            borderaxespad=0.0,
            fontsize="small",
            frameon=False,
        )
    figure.suptitle(fill(plain(fault["text"]), characters()), x=0.01, ha="left", color="#CC0000")
    rows[-1].set_xlabel(f"time since the fault at {fault['time']:.3f} s [ms]")
    return figure


def timing_figure(recording: Recording) -> Figure:
    """Return histograms of the lateness and the duration of the ticks."""
    figure = new_figure(0.35)
    axes = figure.subplots(1, 2, sharey=True)
    bins = np.logspace(-1.0, 5.0, 61)
    for panel, name, label in zip(
        axes, ("lateness", "busy_time"), ("lateness [us]", "duration of a tick [us]"), strict=True
    ):
        panel.hist(np.clip(recording[name] * 1e6, bins[0], bins[-1]), bins, color=BLUE)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xlabel(label)
        tidy(panel)
    axes[0].set_ylabel("ticks")
    return figure


def ambiguity_figure(t: Floats, tied: Ambiguity) -> Figure:
    """Return a figure of k and b of the best candidate and of the tied candidates over time.

    The candidates are the pairs (b, k) from which the multi-estimator selects its estimate. A
    candidate is tied if it fits the data about as well as the best candidate.
    """
    figure = new_figure(0.57, rows=2)
    upper, lower = figure.subplots(2, 1, sharex=True)
    bands = (
        (upper, STIFFNESS, (tied.k_low, tied.k_high, tied.k)),
        (lower, DAMPING, (tied.b_low, tied.b_high, tied.b)),
    )
    for axes, quantity, values in bands:
        factor, unit = quantity.axis(1e3)
        low, high, best = (one * factor for one in values)
        shade(axes, t, low, high, color=BLUE, alpha=0.25, label="candidates that are as good")
        draw(axes, t, best, color="#000000", linewidth=1.0, label="best candidate")
        axes.set_ylabel(f"{quantity.hat} [{unit}]")
        limits(axes, [low, high])
        tidy(axes)
    lower.set_xlabel("time [s]")
    lower.set_xlim(t[0], t[-1])
    legend(figure, *upper.get_legend_handles_labels())
    return figure


def stiffness_figure(
    panels: Mapping[str, tuple[Floats, Mapping[str, Estimates]]],
    paper: Mapping[str, float],
    same_scale: bool = False,
) -> Figure:
    """Return a figure of the estimated stiffness in several trials, one panel for each trial.

    By the title of the panel, `panels` has the times [s] and the estimates, and `paper` the average
    stiffness in the paper [N/m].
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


def tracking_figure(title: str, recording: Recording, tracking: Mapping[str, Any]) -> Figure:
    """Return target, slave position and tracking error over time in `mimic`."""
    t, target, position = (recording[name] for name in ("time", "target", "slave_position"))
    shown = np.isfinite(target)
    t, target, position = t[shown], *(one[shown] * POSITION.factor for one in (target, position))
    error = position - target
    figure = new_figure(0.6, rows=2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    draw(upper, t, position, color=BLUE, linewidth=2.0, alpha=0.6, label="slave")
    draw(upper, t, target, color="#000000", linewidth=1.0, linestyle=(0, (4, 2)), label="target")
    draw(lower, t, error, color=ORANGE, linewidth=1.0)
    lower.axhline(0.0, color="#888888", linewidth=0.6)
    limits(lower, [np.repeat((error.min(), error.max()), 50)], (0.0,))
    caption = fill(", ".join(tracking_lines(tracking)), characters())
    upper.set_title(f"{title}\n{caption}" if title else caption, loc="left", fontsize="medium")
    upper.set_ylabel(POSITION.heading)
    lower.set_ylabel(f"error [{POSITION.unit}]")
    lower.set_xlabel("time [s]")
    lower.set_xlim(t[0], t[-1])
    for axes in (upper, lower):
        tidy(axes)
    legend(figure, *upper.get_legend_handles_labels())
    return figure


def feedback_figure(rendering: RunningRendering) -> Figure:
    """Return force against position at the hand and at the tip, and the error of the impedance."""
    blocks = rendering.blocks()
    found = rendering.comparison(blocks)
    figure = new_figure(0.9 if found else 0.5, rows=2 if found else 1)
    rows = [["hand", "tip"], ["error", "error"]]
    panels = figure.subplot_mosaic(rows if found else rows[:1])
    left, middle = panels["hand"], panels["tip"]
    middle.sharey(left)
    if found:
        draw(left, found.position * POSITION.factor, found.correct, color="#000000", linewidth=1.6)
    draw(left, blocks.handle * POSITION.factor, blocks.felt, color=ORANGE, linewidth=0.8)
    draw(middle, blocks.tip * POSITION.factor, blocks.force, color=BLUE, linewidth=0.8)
    left.set_title("the hand feels", loc="left")
    middle.set_title("the tip touches", loc="left")
    left.set_ylabel(FORCE.heading)
    left.set_xlabel(f"position of the hand [{POSITION.unit}]")
    middle.set_xlabel(f"position of the tip [{POSITION.unit}]")
    if found:
        frequency, error = found.impedance_error()
        right = panels["error"]
        shown = frequency <= FREQUENCIES[-1]
        right.semilogx(frequency[shown], 100.0 * error[shown], color=ORANGE, linewidth=1.2)
        right.axhline(100.0 * NOTICEABLE, color="#000000", linewidth=0.8, linestyle=(0, (4, 2)))
        right.set_ylim(
            0.0, 100.0 * max(2.0 * NOTICEABLE, min(float(error[shown].max(initial=0.0)), 1.2))
        )
        right.set_xlim(FREQUENCIES[0], FREQUENCIES[-1])
        right.set_xticks(FREQUENCIES, [f"{f:g}" for f in FREQUENCIES])
        right.minorticks_off()
        right.set_title("error of the impedance that the hand feels", loc="left")
        right.set_ylabel("error [%]")
        right.set_xlabel("frequency [Hz]")
        tidy(right)
    for axes in (left, middle):
        tidy(axes)
    return figure
