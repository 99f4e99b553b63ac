"""Draw the measured force and the predicted force, over time and over displacement."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimation.arrays import Floats
from estimation.conditioning import Regression
from estimation.estimator import Estimates
from estimation.figure_style import (
    GREY,
    NO_ESTIMATE,
    ORANGE,
    draw,
    explain,
    extremes,
    legend,
    limits,
    new_figure,
    tidy,
)
from estimation.least_squares import Fit
from estimation.metrics import predicted_force
from estimation.quantities import POSITION

MEASURED: dict[str, Any] = {"color": GREY, "linewidth": 1.6, "alpha": 0.5}
PREDICTED: dict[str, Any] = {"color": ORANGE, "linewidth": 0.9, "linestyle": (0, (4, 2))}
MODEL: dict[str, Any] = {"color": "#000000", "linewidth": 0.9}
LEAST_SQUARES = "least squares of the model"


def force_figure(
    title: str, t: Floats, regression: Regression, name: str, estimates: Estimates, fit: Fit
) -> Figure:
    """Return a figure of the measured force and the predicted force, with three panels.

    The first panel shows the force over time, measured and predicted by an online estimator. The
    second panel shows the error of this prediction. The third panel shows the force over
    displacement, measured and computed by a least-squares fit to all samples.

    Parameters
    ----------
    title
        Title of the figure.
    t
        Time [s], shape (n,).
    regression
        The n samples that the estimators processed.
    name, estimates
        Name of the online estimator, and its estimates. Each sample of the force is predicted with
        the estimate after the previous sample.
    fit
        Least-squares fit to the same samples. If all its values are NaN, no fit is drawn.
    """
    figure = new_figure(0.95, rows=3)
    grid = figure.add_gridspec(3, 1, height_ratios=(2.0, 1.0, 2.5))
    over_t, error, over_x = (figure.add_subplot(grid[i]) for i in range(3))
    error.sharex(over_t)
    x, f = regression.x * POSITION.factor, regression.f
    predicted = predicted_force(regression, estimates)
    predicted = np.where(np.logical_and.accumulate(estimates.held), np.nan, predicted)
    draw(over_t, t, f, label="measured", **MEASURED)
    if np.isfinite(predicted).any():
        draw(over_t, t, predicted, label=f"predicted by {name}", **PREDICTED)
        draw(error, t, f - predicted, color=ORANGE, linewidth=0.6)
    else:
        explain(error, f"{name}: {NO_ESTIMATE}")
        error.set_yticks([])
    shown = extremes(f)
    over_x.plot(x[shown], f[shown], label="measured", **MEASURED)
    if np.isfinite(fit.residual).any():
        over_x.plot(x[shown], (f - fit.residual)[shown], label=LEAST_SQUARES, **MODEL)
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
    legend(figure, [*handles, *model[1:]], [*names, *text[1:]])
    return figure
