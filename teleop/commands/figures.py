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
    """Return true stiffness and damping of a trial on the simulated rig; None for other files."""
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
    """Plot estimates, force and tracking of a trial to files; None for a figure that is not drawn.

    Raises
    ------
    InputError
        A file cannot be written, or there is no tracking.
    """
    from teleop.output.figure_files import save

    if plot:
        save(trial.plot(width), plot, overwrite)
    if plot_force:
        save(trial.plot_force(width), plot_force, overwrite)
    if plot_tracking:
        save(trial.plot_tracking(width), plot_tracking, overwrite)
