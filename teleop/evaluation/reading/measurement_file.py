"""Read a file for the evaluation: a recorded trial, or a table with position and force."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.reading.exported import COLUMNS, exported_recording
from teleop.evaluation.reading.samples import Samples
from teleop.evaluation.reading.signals import chosen_table, signals_of
from teleop.files import RECORDING

if TYPE_CHECKING:
    from teleop.recording.recording import Recording


def read_measurement_file(
    file: Path, wanted: Wanted, is_wanted: Callable[[str], bool] = bool
) -> tuple[Samples, Recording | None]:
    """Read position, force and time from a file; also the trial if it is a recording.

    `wanted` selects the columns of a table. `is_wanted` chooses the columns of the recorded trial
    by their names, and by default chooses all. If the recording is long, the `Recording` has only
    its end, and the signals of the `Samples` only sections, see `RecordedSamples`.

    Raises InputError if the file cannot be read, or if `wanted` is given for a recorded trial.
    """
    # Recordings are imported where one is read: a table needs none of their modules.
    if not is_recorded_trial(file):
        table = chosen_table(file, wanted, () if any(wanted) else COLUMNS)
        exported = exported_recording(table)
        if exported is None:
            return Samples(signals_of(table, wanted)), None
        from teleop.evaluation.reading.recorded import recorded_signals

        samples = Samples(recorded_signals(exported), exported.estimated().estimates())
        return samples, exported if exported.settings else None
    for option, value in wanted._asdict().items():
        if value is not None:
            raise InputError(
                f"{file}: --{option} is for a table; a recorded trial has its own columns"
            )
    from teleop.evaluation.reading.recorded import RecordedSamples

    recorded = RecordedSamples(file, is_wanted)
    return recorded, recorded.recording


def is_recorded_trial(file: Path) -> bool:
    """Return whether a file is a recording of this program, and not an MCAP file of another."""
    if file.suffix.lower() != RECORDING:
        return False
    from teleop.evaluation.formats.mcap import is_foreign

    return not is_foreign(file)
