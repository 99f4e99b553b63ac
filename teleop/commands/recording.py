"""Options of every command that reads a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from teleop.table import Recording


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
    """Where position and force are zero: as in the file, at the first sample (start), at the
    mean of the motion, or given as in 1.5mm,20N. By default as in the file for a column named
    displacement, indentation or depth, and the mean for any other."""

    def read(self, file: Path) -> Recording:
        """Read these columns of a file; InputError as `teleop.table.read_recording`."""
        from teleop.table import read_recording

        return read_recording(file, self.position, self.force, self.time)


ColumnOptions = Annotated[Columns, Parameter(name="*")]
"""The options, without a common prefix."""
BY_NAME = Columns()
"""Every column by its usual name."""
