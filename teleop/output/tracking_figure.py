"""Draw how well the slave follows the target over time, for a trial of the condition `mimic`."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimation.figure_style import BLUE, ORANGE, draw, is_narrow, legend, limits, new_figure, tidy
from estimation.quantities import POSITION
from teleop.output.trial_tables import tracking_lines
from teleop.recording.recording import Recording


def tracking_figure(title: str, recording: Recording, tracking: Mapping[str, Any]) -> Figure:
    """Return a figure of target, slave position and tracking error over time.

    The tracking error is the slave position minus the target.

    Parameters
    ----------
    title
        Title of the figure.
    recording
        All ticks of a trial of the condition `mimic`, in which the operator follows the target.
    tracking
        The fields of a `Tracking`: gain and phase of the slave relative to the target, and tracking
        error. The title of the figure states them.
    """
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
    width = 48 if is_narrow() else 100
    caption = textwrap.fill(", ".join(tracking_lines(tracking)), width)
    upper.set_title(f"{title}\n{caption}" if title else caption, loc="left", fontsize="medium")
    upper.set_ylabel(POSITION.heading)
    lower.set_ylabel(f"error [{POSITION.unit}]")
    lower.set_xlabel("time [s]")
    lower.set_xlim(t[0], t[-1])
    for axes in (upper, lower):
        tidy(axes)
    legend(figure, *upper.get_legend_handles_labels())
    return figure
