"""`teleop report`: a run as one HTML page with plots."""

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
    """Write a recording's estimates and figures to one HTML page that opens offline.

    Shows over time which candidates the data could not tell apart as well, and of a run that
    was stopped for safety what tripped and the channels about it.

    Example: `teleop report run.mcap --out run.html`

    Parameters
    ----------
    file
        A recording of teleop run (.mcap), or a file of another program: text, .lvm, .mat, .h5,
        .parquet, .tdms, .xlsx, a ROS bag or .mcap.
    out
        The page; by default beside the recording, with the ending .html.
    columns
        Which columns to take, and where they are zero.
    preset
        Settings of the estimators: scaled from the data, or the paper's; by default those of
        the run, and scaled for a table.
    cube
        The cube whose adaptation gain the paper's settings take.
    force_lag
        Lag of the force channel [s] to make up for.
    """
    from teleop.commands.estimate import chosen
    from teleop.evaluation.evaluation import FEWEST, evaluate
    from teleop.files import check_outputs, write_text
    from teleop.output import tables as console
    from teleop.output.report_page import report_page, stop_page
    from teleop.recording.black_box import fault_of

    page = out or file.with_suffix(".html")
    check_outputs(page, sources=(file,), overwrite=overwrite)
    signals, recording = columns.read(file)
    fault = fault_of(recording) if recording else None
    if recording and fault and len(signals.t) < FEWEST:
        text = stop_page(file.name, recording)
    else:
        settings = chosen(
            recording, columns.datum, cube, {"preset": preset, "force_lag": force_lag}
        )
        text = report_page(file.name, evaluate(signals, settings), recording)
    write_text(page, text, overwrite)
    console.plain_console().print(str(page))
    return 0
