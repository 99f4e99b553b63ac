"""Figures of an evaluated recording, the same for a file and for the report."""

from __future__ import annotations

from matplotlib.figure import Figure

from teleop.evaluation.evaluation import Evaluation
from teleop.output.figures import Truth, estimates_figure
from teleop.output.force_figure import force_figure


def estimates_of(name: str, evaluation: Evaluation, truth: Truth | None) -> Figure:
    """Return the figure of the estimates, with the truth of a simulated trial if it is known."""
    x, v, *_ = evaluation.regression
    return estimates_figure(name, evaluation.t, x, v, evaluation.estimates, truth)


def force_of(name: str, evaluation: Evaluation) -> Figure:
    """Return the figure of the force, predicted by the first estimator."""
    e = evaluation
    first = next(iter(e.estimates))
    return force_figure(name, e.t, e.regression, first, e.estimates[first], e.least_squares)
