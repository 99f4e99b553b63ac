"""`teleop export`: convert a recording to CSV, HDF5, MATLAB or Parquet."""

from __future__ import annotations

from pathlib import Path

from teleop.commands.options import Json, OutputFile, Overwrite


def export(
    file: Path,
    /,
    *,
    out: OutputFile = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Convert a recording to CSV, HDF5, MATLAB or Parquet, with full precision of all numbers.

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
    """
    from teleop.files import check_outputs
    from teleop.output import console
    from teleop.printable import print_error
    from teleop.recording.export_formats import description_of, export_recording, format_of
    from teleop.recording.gaps import gap_rows, missing_text

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
