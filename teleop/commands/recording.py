"""Options of every command that reads a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from teleop.evaluation.formats.delimited import Signals
    from teleop.recording.recording import Recording


@dataclass(frozen=True)
class Columns:
    """Which columns of a file to take, and where they are zero."""

    position: str | None = None
    """Column of the position, as NAME or, if the header has no unit, NAME=UNIT."""
    force: str | None = None
    """Column of the force, likewise."""
    time: str | None = None
    """Column of the time, likewise."""
    datum: str = "auto"
    """Where position and force are zero: at the contact point (contact), as in the file, at the
    first sample (start), at the mean of the motion, or given as in 1.5mm,20N. By default the
    contact point where the record begins or ends out of contact, and the mean otherwise."""

    def read(self, file: Path) -> tuple[Signals, Recording | None]:
        """The signals of a table, or those of a recorded trial, and that.

        Raises
        ------
        InputError
            The file is not as expected, or a column was asked of a recorded trial.
        """
        from teleop.errors import InputError

        if file.suffix.lower() != ".mcap":
            from teleop.evaluation.formats.delimited import read_signals

            return read_signals(file, self.position, self.force, self.time), None
        from teleop.evaluation.replay import recorded_signals
        from teleop.recording.recording import load

        for option in ("position", "force", "time"):
            if getattr(self, option) is not None:
                raise InputError(
                    f"{file}: --{option} takes a column of a table; a recorded trial has its own"
                )
        recording = load(file)
        return recorded_signals(recording), recording


ColumnOptions = Annotated[Columns, Parameter(name="*")]
"""The options, without a common prefix."""
BY_NAME = Columns()
"""Every column by its usual name."""
