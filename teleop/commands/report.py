"""`teleop report`: an HTML page with the results of a recording."""

from __future__ import annotations

from pathlib import Path

from teleop.commands.overwriting import Overwrite
from teleop.commands.recording import BY_NAME, ColumnOptions
from teleop.names import CubeName, PresetName


def report(
    file: Path,
    /,
    *,
    out: Path | None = None,
    columns: ColumnOptions = BY_NAME,
    preset: PresetName | None = None,
    cube: CubeName = "soft",
    force_lag: float | None = None,
    overwrite: Overwrite = False,
) -> int:
    """Write the estimates and figures of a recording to one HTML page that works offline.

    The page also shows, over time, which parameter values the data cannot distinguish. For a run
    with a safety stop it shows the fault, and the channels before and after it.

    Example: `teleop report run.mcap --out run.html`

    Parameters
    ----------
    file
        Recording of teleop run (.mcap), or a file of another program: text, .lvm, .mat, .h5,
        .parquet, .tdms, .xlsx, a ROS bag or .mcap.
    out
        HTML file to write. Default: the name of the recording with the ending .html.
    columns
        Columns to read, and their zeros.
    preset
        Settings of the estimators: scaled from the data (scaled), or the paper's (paper).
        Default: those of the run for a recording, scaled for CSV and TSV.
    cube
        Cube whose adaptation gain is used with the paper's settings.
    force_lag
        Lag of the force channel [s], which is compensated.
    """
    from teleop.commands.estimate import chosen
    from teleop.evaluation.evaluation import FEWEST, evaluate
    from teleop.files import check_ending, check_outputs, write_text
    from teleop.output import console
    from teleop.output.report_page import report_page

    page = out or file.with_suffix(".html")
    check_ending(page, ".html")
    check_outputs(page, sources=(file,), overwrite=overwrite)
    signals, recording = columns.read(file)
    fault = recording.fault if recording else None
    if recording and fault and len(signals.t) < FEWEST:
        evaluation = None
    else:
        settings = chosen(
            recording, columns.datum, cube, {"preset": preset, "force_lag": force_lag}
        )
        evaluation = evaluate(signals, settings)
    text = report_page(file.name, evaluation, recording)
    write_text(page, text, overwrite)
    console.plain_console().print(str(page))
    return 0
