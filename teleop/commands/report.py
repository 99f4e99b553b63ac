"""`teleop report`: a run as one HTML page with plots."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from teleop.commands.recording import BY_NAME, ColumnOptions


def report(
    file: Path,
    /,
    *,
    out: Path | None = None,
    columns: ColumnOptions = BY_NAME,
    preset: Literal["scaled", "paper"] = "scaled",
    cube: Literal["soft", "medium", "hard"] = "soft",
    force_lag: float = 0.0,
) -> int:
    """Write a recording's estimates and figures to one HTML page that opens offline.

    Shows over time which candidates the data could not tell apart as well.

    Example: `teleop report run.csv --preset paper --out run.html`

    Parameters
    ----------
    file
        CSV or TSV with units in its header, such as `teleop run --out` writes.
    out
        The page; by default beside the recording, with the ending .html.
    columns
        Which columns to take, and where they are zero.
    preset
        Settings of the estimators: scaled from the data, or the paper's.
    cube
        The cube whose adaptation gain the paper's settings take.
    force_lag
        Lag of the force channel [s] to make up for.
    """
    from teleop.estimate import EstimateSettings, evaluate
    from teleop.files import check_outputs, write_text
    from teleop.report import report_page

    page = out or file.with_suffix(".html")
    check_outputs(page, source=file)
    recording = columns.read(file)
    evaluation = evaluate(
        recording, EstimateSettings(columns.datum, preset, cube, force_lag=force_lag)
    )
    write_text(page, report_page(file.name, evaluation))
    print(page)
    return 0
