"""Draw figures of a trial: signals at a fault, timing of the control loop, ambiguous estimates."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimation.arrays import Floats
from estimation.figure_style import (
    BLUE,
    ORANGE,
    draw,
    is_narrow,
    legend,
    limits,
    new_figure,
    shade,
    tidy,
)
from estimation.quantities import DAMPING, FORCE, LATENESS, POSITION, STIFFNESS, VELOCITY
from estimation.redundancy import Ambiguity
from teleop.output.figure_files import plain
from teleop.recording.recording import Recording


def fault_figure(recording: Recording, fault: Mapping[str, Any]) -> Figure:
    """Return a figure of the measured signals and the commands shortly before and after a fault.

    A fault is a condition for which the supervisor stops the drives. The panels show forces,
    positions, velocities, and the lateness of each tick (delay of its start).

    Parameters
    ----------
    recording
        Ticks before and after the fault.
    fault
        Event of the fault, as a dictionary that the recording contains.
    """
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
    figure.suptitle(
        fill(plain(fault["text"]), 45 if is_narrow() else 90), x=0.01, ha="left", color="#CC0000"
    )
    rows[-1].set_xlabel(f"time since the fault at {fault['time']:.3f} s [ms]")
    return figure


def timing_figure(recording: Recording) -> Figure:
    """Return a figure with histograms of the lateness and the duration of the ticks.

    A tick is one cycle of the control loop. Its lateness is the delay of its start. Its duration is
    the time from its start until the loop waits for the next tick.

    Parameters
    ----------
    recording
        All ticks of a trial.
    """
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

    Parameters
    ----------
    t
        Times at which the candidates are compared [s], shape (n,).
    tied
        For each time: k and b of the best candidate, and the smallest and the largest k and b of
        the tied candidates.
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
