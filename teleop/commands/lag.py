"""`teleop lag`: the lag of the force channel, from a reference spring."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter


def lag(
    file: Path | None = None,
    /,
    *,
    position: str | None = None,
    force: str | None = None,
    time: str | None = None,
    datum: str = "auto",
    cube: Literal["soft", "medium", "hard"] = "soft",
    seed: int = 0,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Measure the lag of the force channel on a reference spring without damping.

    A lag unknown makes b - k * lag of the damping. Record position and force while the rig
    excites a steel spring, best with frequencies up to some 10 Hz, and give the file.
    Without a file a simulated spring is palpated with a chirp.

    Example: `teleop lag spring.csv`

    Parameters
    ----------
    file
        Recording on the spring: CSV or TSV with units in its header.
    position
        Column of the position, as NAME or, if the header has no unit, NAME=UNIT.
    force
        Column of the force, likewise.
    time
        Column of the time, likewise.
    datum
        Where position and force are zero, as in `teleop estimate`.
    cube
        Without a file: the simulated force channel of the trials with this cube.
    seed
        Without a file: seed of the sensor noise.
    json
        Print one JSON document instead of a text.
    """
    from teleop import console
    from teleop.estimate import find_datum
    from teleop.force_lag import measure_lag, measure_simulated_lag
    from teleop.table import read_recording

    summary: dict[str, Any]
    if file is None:
        measured, true = measure_simulated_lag(cube, seed)
        summary = {**measured.summary(), "true_lag_s": true}
    else:
        recording = read_recording(file, position, force, time)
        zero = find_datum(recording, datum)
        measured = measure_lag(recording.x - zero.x, recording.f - zero.f, recording.dt)
        summary = {"file": str(file), **measured.summary()}
    if json:
        console.print_json(summary)
    else:
        console.print_lag(summary)
    return 0
