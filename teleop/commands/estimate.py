"""`teleop estimate`: the estimators over a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from teleop.commands.recording import BY_NAME, ColumnOptions


def estimate(
    file: Path,
    /,
    *,
    columns: ColumnOptions = BY_NAME,
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
    columns
        Which columns to take, and where they are zero.
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
    from teleop.table import write_table

    check_outputs(out, picture=plot, source=file)
    recording = columns.read(file)
    evaluation = evaluate(
        recording,
        EstimateSettings(columns.datum, preset, cube, conditioning, bandwidth, force_lag, whole),
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
