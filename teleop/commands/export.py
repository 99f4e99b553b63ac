"""`teleop export`: convert a recording to CSV, HDF5, MATLAB, Parquet or Motion-BIDS."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from teleop.commands.options import IN_OUTPUT, Json, OutputFile, Overwrite


def export(
    file: Path,
    /,
    *,
    out: OutputFile = None,
    bids: Annotated[Path | None, IN_OUTPUT] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Convert a recording to CSV, HDF5, MATLAB, Parquet or Motion-BIDS, with all digits.

    Example: `teleop export trial.mcap --out trial.mat`

    Parameters
    ----------
    file
        Recording of teleop run (.mcap).
    out
        File to write. The extension .csv, .h5, .mat or .parquet selects the format. Default: the
        name of the recording with the extension .csv. The settings of the run are stored in the
        same file or, for CSV, in a second file NAME.csv-metadata.json. HDF5 and Parquet need
        `pip install 'telepalpation[export]'`.
    bids
        Folder of a data set in the layout Motion-BIDS, to which the recording is added, in place of
        --out. The folder is created if needed.
    """
    from teleop.errors import InputError
    from teleop.files import check_outputs
    from teleop.output import console
    from teleop.printable import print_error
    from teleop.recording.bids import add_to_dataset
    from teleop.recording.export_formats import description_of, export_recording, format_of
    from teleop.recording.gaps import gap_rows, missing_text

    if bids and out:
        raise InputError("--bids and --out: expected at most one of them")
    if bids:
        name = "bids"
        out, recording = add_to_dataset(file, bids)
    else:
        out = out or file.with_suffix(".csv")
        name = format_of(out)
        check_outputs(out, description_of(out), sources=(file,), overwrite=overwrite)
        recording = export_recording(file, out, overwrite)
    if json:
        console.print_json(
            {
                "file": str(file),
                "out": str(out),
                "format": name,
                "ticks": recording.ticks,
                "columns": list(recording.units),
                "missing_ticks": gap_rows(recording.gaps),
            }
        )
    else:
        console.plain_console().print(str(out))
        if recording.gaps:
            print_error(f"{file}: {missing_text(recording.gaps)}")
    return 0
