"""`teleop lag`: measure the lag of the force channel and the lost motion on a reference spring."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop.commands.column_options import BY_USUAL_NAMES, ColumnOptions, Columns
from teleop.commands.options import Json

if TYPE_CHECKING:
    from estimation.arrays import Floats


def lag(
    file: Path | None = None,
    /,
    *,
    columns: Columns = BY_USUAL_NAMES,
    seed: int = 0,
    json: Json = False,
) -> int:
    """Measure the lag of the force channel and lost motion with a spring that has no damping.

    If the lag is not compensated, the estimated damping is b - k * lag instead of b, where k is
    the stiffness and b is the true damping. Lost motion (backlash) between the encoder and the tip
    also makes the estimated damping too small. Record position and force while the rig deforms a
    steel spring, and pass the file to this command. Use several frequencies up to about 10 Hz, or
    several amplitudes. If all motions back and forth have about the same mean speed, lag and lost
    motion cannot be measured separately. Without a file, the simulated rig deforms a simulated
    spring with a chirp (a sine with varying frequency).

    Example: `teleop lag spring.csv`

    Parameters
    ----------
    file
        Data measured on the spring, in any format that `teleop estimate` reads: at most 1 000 000
        samples.
    seed
        Without a file: seed of the sensor noise.
    """
    from teleop.output.console import print_json
    from teleop.output.rig_tables import print_lag
    from teleop.rig.force_lag import measure_lag, measure_simulated_lag

    summary: dict[str, Any]
    if file is None:
        measured, setup = measure_simulated_lag(seed)
        summary = {
            **measured.summary(),
            "true_lag_s": setup.force_lag,
            "true_lost_motion_m": setup.transmission.lost_motion,
        }
    else:
        measured = measure_lag(*spring_samples(file, columns))
        summary = {"file": str(file), **measured.summary()}
    if json:
        print_json(summary)
    else:
        print_lag(summary)
    return 0


def spring_samples(file: Path, columns: ColumnOptions) -> tuple[Floats, Floats, Floats]:
    """Displacement, force and sample periods from a file without gaps, all in SI units."""
    from teleop.errors import InputError
    from teleop.evaluation.online.datum import find_datum
    from teleop.evaluation.reading.recorded import NEEDED, recorded_signals
    from teleop.evaluation.reading.samples import is_replayed
    from teleop.recording.recording import load
    from teleop.rig.force_lag import MOST_SAMPLES

    samples, recording = columns.read(file, is_replayed)
    if samples.count > MOST_SAMPLES:
        raise InputError(f"{file}: {samples.count} samples: expected at most {MOST_SAMPLES}")
    signals = samples.signals
    if not samples.is_whole:
        signals = recorded_signals(load(file, NEEDED.__contains__))
    if signals.gaps:
        end = signals.gaps[0]
        raise InputError(
            f"{file}: a gap from {signals.t[end - 1]:g} to {signals.t[end]:g} s: "
            "expected samples without gaps"
        )
    datum = "file" if recording and columns.datum == "auto" else columns.datum
    zero = find_datum(signals, datum)
    return signals.x - zero.x, signals.f - zero.f, signals.dt
