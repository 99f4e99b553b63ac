"""Write the figures of a trial to files."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from estimation.figures import Truth
    from teleop.names import WidthName
    from teleop.recording.recording import Recording
    from teleop.trial.result import Trial


def truth_of(recording: Recording | None) -> Truth | None:
    """Return the true parameters of a trial on the simulated rig; None for any other recording."""
    from estimation.figures import known_truth
    from teleop.trial.true_values import recorded_truth

    return known_truth(recorded_truth(recording)) if recording else None


def draw_trial(
    trial: Trial,
    plot: Path | None,
    plot_force: Path | None,
    plot_tracking: Path | None,
    width: WidthName,
    overwrite: bool,
) -> None:
    """Draw the figures of the estimates, the force and the target tracking, each to its own file.

    A figure whose path is None is not drawn.

    Raises
    ------
    InputError
        A file cannot be written, or the trial has no target that the operator tracks.
    """
    from teleop.output.figure_files import save

    if plot:
        save(trial.plot(width), plot, overwrite)
    if plot_force:
        save(trial.plot_force(width), plot_force, overwrite)
    if plot_tracking:
        save(trial.plot_tracking(width), plot_tracking, overwrite)
