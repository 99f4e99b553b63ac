"""Write the figures of a trial to files."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from teleop.names import WidthName
    from teleop.output.figures import Truth
    from teleop.recording.recording import Recording
    from teleop.trial.result import Trial


def truth_of(recording: Recording | None) -> Truth | None:
    """Return true stiffness and damping of a trial on the simulated rig; None for other files."""
    from teleop.output.figures import known_truth
    from teleop.trial.result import recorded_truth

    return known_truth(recorded_truth(recording)) if recording else None


def draw_trial(
    trial: Trial, plot: Path | None, plot_force: Path | None, width: WidthName, overwrite: bool
) -> None:
    """Plot the estimates of a trial to the file `plot`, and the force to the file `plot_force`.

    Raises
    ------
    InputError
        A file cannot be written.
    """
    from estimation import least_squares
    from estimation.least_squares import no_fit
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
            known = not estimates[first].held.all()
            further = regression.further
            fit = least_squares(*regression[:3], further) if known else no_fit(*further.shape)
            figure = force_figure(title, t, regression, first, estimates[first], fit)
            save(figure, plot_force, overwrite)
