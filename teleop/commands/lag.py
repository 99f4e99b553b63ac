"""`teleop lag`: the lag of a force channel, measured on a reference spring."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from teleop.commands.recording import BY_NAME, ColumnOptions
from teleop.names import CubeName


def lag(
    file: Path | None = None,
    /,
    *,
    columns: ColumnOptions = BY_NAME,
    cube: CubeName = "soft",
    seed: int = 0,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Measure the lag of a force channel on a reference spring without damping.

    A lag that is not compensated biases the estimated damping to b - k * lag. To measure the lag,
    record position and force while the rig moves a steel spring, with frequencies up to about
    10 Hz, and pass the file. Without a file, a simulated spring is palpated with a chirp.

    Example: `teleop lag spring.csv`

    Parameters
    ----------
    file
        Data measured on the spring, in any format that `teleop estimate` reads.
    columns
        Columns to read, and their zeros.
    cube
        Without a file: cube whose simulated force channel is measured.
    seed
        Without a file: seed of the sensor noise.
    json
        Print one JSON document instead of text.
    """
    from teleop.errors import InputError
    from teleop.evaluation.datum import find_datum
    from teleop.output import console
    from teleop.output.rig_tables import print_lag
    from teleop.rig.force_lag import measure_lag
    from teleop.rig.reference_spring import measure_simulated_lag

    summary: dict[str, Any]
    if file is None:
        measured, true = measure_simulated_lag(cube, seed)
        summary = {**measured.summary(), "true_lag_s": true}
    else:
        signals, recording = columns.read(file)
        if signals.gaps:
            end = signals.gaps[0]
            raise InputError(
                f"{file}: a gap from {signals.t[end - 1]:g} to {signals.t[end]:g} s: "
                "expected samples without gaps"
            )
        datum = "file" if recording and columns.datum == "auto" else columns.datum
        zero = find_datum(signals, datum)
        measured = measure_lag(signals.x - zero.x, signals.f - zero.f, signals.dt)
        summary = {"file": str(file), **measured.summary()}
    if json:
        console.print_json(summary)
    else:
        print_lag(summary)
    return 0
