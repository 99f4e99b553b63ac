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
    """Return the true stiffness and damping of the specimen in a trial on the simulated rig.

    The result is None for any other recording, because the true values are not known.

    Parameters
    ----------
    recording
        The recorded trial; None for a file of another program.
    """
    from estimation.figures import known_truth
    from teleop.trial.recorded_trial import recorded_truth

    return known_truth(recorded_truth(recording)) if recording else None


def draw_trial(
    trial: Trial,
    plot: Path | None,
    plot_force: Path | None,
    plot_tracking: Path | None,
    width: WidthName,
    overwrite: bool,
) -> None:
    """Draw up to three figures of a trial, each to its own file.

    Parameters
    ----------
    trial
        The trial.
    plot
        File of the figure of the estimates; None to draw no such figure.
    plot_force
        File of the figure of the measured and the predicted force, or None.
    plot_tracking
        File of the figure of the target and the position of the slave, or None.
    width
        Width of the figures: `screen`, `single`, `double` or `a4`.
    overwrite
        Whether existing files are overwritten.

    Raises
    ------
    InputError
        A file cannot be written, or `plot_tracking` is given for a trial without a target. Only the
        condition `mimic` has a target, which the operator follows.
    """
    from teleop.output.figure_files import save

    if plot:
        save(trial.plot(width), plot, overwrite)
    if plot_force:
        save(trial.plot_force(width), plot_force, overwrite)
    if plot_tracking:
        save(trial.plot_tracking(width), plot_tracking, overwrite)
