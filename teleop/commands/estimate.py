"""`teleop estimate`: the estimators over a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from teleop.commands.recording import BY_NAME, ColumnOptions
from teleop.names import ConditioningName, CubeName, PresetName

if TYPE_CHECKING:
    from teleop.estimate import EstimateSettings
    from teleop.recording import Recording


def estimate(
    file: Path,
    /,
    *,
    columns: ColumnOptions = BY_NAME,
    preset: PresetName | None = None,
    cube: CubeName = "soft",
    conditioning: ConditioningName | None = None,
    bandwidth: float | None = None,
    force_lag: float | None = None,
    whole: Annotated[bool, Parameter(negative="")] = False,
    out: Path | None = None,
    plot: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Estimate stiffness and damping from a recorded position and force.

    A recording of teleop run is evaluated with the settings of that run unless options give
    others, which gives the run's own estimates to the bit.

    Example: `teleop estimate indentation.csv --force "Load [N]" --plot indentation.png`

    Parameters
    ----------
    file
        A recording of teleop run (.mcap), or CSV or TSV with units in its header, such as
        `Time [s],Position [mm],Force [gf]`.
    columns
        Which columns to take, and where they are zero.
    preset
        Settings of the estimators: scaled from the data, or the paper's; by default those of
        the run, and scaled for a table.
    cube
        The cube whose adaptation gain the paper's settings take.
    conditioning
        How velocity is had from position: see `teleop run --help`; matched for a table.
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
    from teleop.estimate import agrees, evaluate
    from teleop.files import check_outputs
    from teleop.table import write_table

    check_outputs(out, picture=plot, source=file)
    signals, recording = columns.read(file)
    settings = chosen(recording, columns.datum, preset, cube, conditioning, bandwidth, force_lag)
    if whole:
        settings = replace(settings, whole=True)
    evaluation = evaluate(signals, settings)
    summary = {"file": str(file), **evaluation.summary()}
    if recording:
        summary["as_online"] = agrees(evaluation, recording)
        summary["estimated_channels"] = recording.estimated_channels
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


def chosen(
    recording: Recording | None,
    datum: str,
    preset: PresetName | None,
    cube: str,
    conditioning: ConditioningName | None,
    bandwidth: float | None,
    force_lag: float | None,
) -> EstimateSettings:
    """The settings of a recorded trial, or those for a table, with what the options change."""
    from teleop.estimate import EstimateSettings, recorded_settings

    settings = recorded_settings(recording) if recording else EstimateSettings()
    given = {
        "datum": None if datum == "auto" else datum,
        "preset": preset,
        "conditioning": conditioning,
        "bandwidth": bandwidth,
        "force_lag": force_lag,
    }
    changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return replace(settings, cube=cube, **changes)
