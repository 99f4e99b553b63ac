"""Figures of a trial or an evaluated recording, the same for every command."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from teleop.evaluation.evaluation import Evaluation
    from teleop.names import WidthName
    from teleop.recording.recording import Recording
    from teleop.trial.result import Trial


def estimates_of(name: str, evaluation: Evaluation, recording: Recording | None) -> Figure:
    """Return the figure of the estimates, with the truth of a simulated trial."""
    from teleop.output.figures import estimates_figure, known_truth
    from teleop.trial.result import recorded_truth

    truth = known_truth(recorded_truth(recording)) if recording else None
    x, v, *_ = evaluation.regression
    return estimates_figure(name, evaluation.t, x, v, evaluation.estimates, truth)


def force_of(name: str, evaluation: Evaluation) -> Figure:
    """Return the figure of the force, predicted by the first estimator."""
    from teleop.output.force_figure import force_figure

    e = evaluation
    first = next(iter(e.estimates))
    return force_figure(name, e.t, e.regression, first, e.estimates[first], e.batch)


def draw_trial(
    trial: Trial, plot: Path | None, plot_force: Path | None, width: WidthName, overwrite: bool
) -> None:
    """Plot the estimates, and the force, of a trial to files.

    Raises
    ------
    InputError
        A file cannot be written.
    """
    from estimation import least_squares
    from teleop.output.figure_style import figure_style, save
    from teleop.output.figures import estimates_figure, known_truth
    from teleop.output.force_figure import force_figure

    title = f"{trial.settings.condition}, {trial.settings.palpated}"
    active = trial.recording.estimated()
    t, regression, estimates = active["time"], active.regression(), active.estimates()
    with figure_style(width):
        if plot:
            truth = known_truth(trial.summary()["truth"])
            figure = estimates_figure(title, t, *regression[:2], estimates, truth)
            save(figure, plot, overwrite)
        if plot_force:
            first = next(iter(estimates))
            fit = least_squares(*regression[:3], regression.further)
            figure = force_figure(title, t, regression, first, estimates[first], fit)
            save(figure, plot_force, overwrite)
