"""`teleop lag`: measure force lag, lost motion and compliance of a rig on a reference spring."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop.commands.column_options import BY_USUAL_NAMES, ColumnOptions, Columns
from teleop.commands.options import Json, Overwrite
from teleop.commands.quantities import Stiffness

if TYPE_CHECKING:
    from estimation.arrays import Floats


def lag(
    file: Path | None = None,
    /,
    *,
    columns: Columns = BY_USUAL_NAMES,
    stiffness: Stiffness | None = None,
    out: Path | None = None,
    overwrite: Overwrite = False,
    seed: int = 0,
    json: Json = False,
) -> int:
    """Measure force lag, lost motion and compliance with a spring that has no damping.

    If the lag is not compensated, the estimated damping is b - k * lag instead of b, where k is
    the stiffness and b is the true damping. Lost motion (backlash) between the encoder and the tip
    also makes the estimated damping too small. Record position and force while the rig deforms a
    steel spring, and pass the file to this command. Use several frequencies up to about 10 Hz, or
    several amplitudes. If all motions back and forth have about the same mean speed, lag and lost
    motion cannot be measured separately. If the stiffness of the spring is known, the compliance
    between encoder and tip is also measured. Without a file, the simulated rig deforms a simulated
    spring with a chirp (a sine with varying frequency).

    Example: `teleop lag spring.csv --stiffness 5000N/m --out transmission.toml`

    Parameters
    ----------
    file
        Data measured on the spring, in any format that `teleop estimate` reads: at most 1 000 000
        samples.
    stiffness
        Stiffness of the spring, such as 5000N/m.
    out
        Write the values to this file, for the option --transmission of estimate, compare and
        report, or for the section [transmission] of a rig file.
    seed
        Without a file: seed of the sensor noise.
    """
    from teleop.errors import InputError
    from teleop.files import check_outputs
    from teleop.output.console import print_json
    from teleop.output.rig_tables import print_lag
    from teleop.printable import one_line
    from teleop.rig.force_lag import SPRING, measure_lag, measure_simulated_lag
    from teleop.settings.transmission_file import write_transmission

    if stiffness is not None and (file is None or not stiffness > 0.0):
        raise InputError("--stiffness: expected a stiffness above zero, and a file of the spring")
    check_outputs(out, sources=(file,) if file else (), overwrite=overwrite)
    summary: dict[str, Any]
    if file is None:
        stiffness = SPRING
        measured, setup = measure_simulated_lag(seed)
        summary = {
            **measured.summary(stiffness),
            "true_lag_s": setup.force_lag,
            "true_lost_motion_m": setup.transmission.lost_motion,
            "true_compliance_m_per_n": setup.transmission.compliance,
        }
    else:
        measured = measure_lag(*spring_samples(file, columns))
        summary = {"file": str(file), **measured.summary(stiffness)}
    if out:
        where = one_line(file.name) if file else f"a simulated spring, seed {seed}"
        spring = f"of {stiffness:g} N/m" if stiffness else "of unknown stiffness"
        origin = f"Measured by teleop lag on a spring {spring} ({where})"
        write_transmission(measured.calibration(stiffness), origin, out, overwrite)
    if json:
        print_json(summary)
    else:
        print_lag(summary, out)
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
