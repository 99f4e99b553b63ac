"""`teleop estimate`: the estimators over a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter


def estimate(
    file: Path,
    /,
    *,
    position: str | None = None,
    force: str | None = None,
    time: str | None = None,
    datum: str = "auto",
    preset: Literal["scaled", "paper"] = "scaled",
    cube: Literal["soft", "medium", "hard"] = "soft",
    conditioning: Literal["matched", "svf", "foaw", "difference"] = "matched",
    bandwidth: float | None = None,
    force_lag: float = 0.0,
    whole: Annotated[bool, Parameter(negative="")] = False,
    out: Path | None = None,
    plot: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Estimate stiffness and damping from a recorded position and force.

    Example: `teleop estimate indentation.csv --force "Load [N]" --plot indentation.png`

    Parameters
    ----------
    file
        CSV or TSV with units in its header, such as `Time [s],Position [mm],Force [gf]`.
    position
        Column of the position, as NAME or, if the header has no unit, NAME=UNIT.
    force
        Column of the force, likewise.
    time
        Column of the time, likewise.
    datum
        Where position and force are zero: as in the file, at the first sample (start), at
        the mean of the motion, or given as in 1.5mm,20N. By default as in the file for a
        column named displacement, indentation or depth, and the mean for any other.
    preset
        Settings of the estimators: scaled from the data, or the paper's.
    cube
        The cube whose adaptation gain the paper's settings take.
    conditioning
        How velocity is had from position: see `teleop run --help`.
    bandwidth
        Bandwidth of its filter [Hz]; by default ten times the motion's dominant frequency,
        and 20 Hz with the paper's settings.
    force_lag
        Lag of the force channel [s] that matched conditioning makes up for, as `teleop lag`
        measures it.
    whole
        Take in the rest before and after the motion as well.
    out
        Write signals and estimates to this CSV file.
    plot
        Draw the paper's Figure 3 for this file to a .png, .svg or .pdf file.
    json
        Print one JSON document instead of tables.
    """
    from teleop import console
    from teleop.estimate import EstimateSettings, evaluate
    from teleop.files import check_outputs
    from teleop.table import read_recording, write_table

    check_outputs(out, picture=plot, source=file)
    recording = read_recording(file, position, force, time)
    evaluation = evaluate(
        recording,
        EstimateSettings(datum, preset, cube, conditioning, bandwidth, force_lag, whole),
    )
    summary = {"file": str(file), **evaluation.summary()}
    if json:
        console.print_json(summary)
    else:
        console.print_evaluation(summary, file.name)
    if out:
        write_table(out, *evaluation.columns())
    if plot:
        from teleop.figure import estimates_figure, save

        save(
            estimates_figure(
                file.name, evaluation.t, evaluation.x, evaluation.v, evaluation.estimates
            ),
            plot,
        )
    return 0
