"""The options that select the columns of a measurement file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from teleop.commands.options import COLUMNS
from teleop.commands.quantities import Hertz, Length

if TYPE_CHECKING:
    from teleop.evaluation.formats.columns import Wanted
    from teleop.evaluation.reading.samples import Samples
    from teleop.recording.recording import Recording


@dataclass(frozen=True)
class ColumnOptions:
    """Options that select the columns of a file, and that set the zeros of position and force."""

    position: str | None = None
    """Column of the position, as NAME or, if the header has no unit, as NAME=UNIT. NAME can be the
    number of the column, counted from 1."""
    force: str | None = None
    """Column of the force, in the same form as --position."""
    time: str | None = None
    """Column of the time, in the same form as --position."""
    block: int | None = None
    """Number of the table, counted from 1, in a file with several tables, such as sheets or
    groups."""
    topic: str | None = None
    """Topic of a ROS bag or an MCAP file. The fields of the topic are the columns. Without this
    option, the names of the columns are /topic.field."""
    rate: Hertz | None = None
    """Sampling rate [Hz] of a file without a time column."""
    lever: Length | None = None
    """Length of the lever arm, such as 50mm, that converts an angle and a torque to a
    displacement and a force."""
    invert: Literal["position", "force", "both"] | None = None
    """Change the sign of position, force or both. Afterwards, both must be positive in
    compression."""
    datum: str = "auto"
    """Zeros of position and force: their values at the contact point (contact) or at the first
    sample (start), their means during the motion (mean), the zeros of the file (file), or given
    values such as 1.5mm,20N. Default (auto): contact if the data begin or end without contact,
    and otherwise mean."""

    def read(
        self, file: Path, is_wanted: Callable[[str], bool] = bool
    ) -> tuple[Samples, Recording | None]:
        """Read the file with these options, see `read_measurement_file`."""
        from teleop.evaluation.reading.measurement_file import read_measurement_file

        return read_measurement_file(file, self.wanted(), is_wanted)

    def wanted(self) -> Wanted:
        """Check the options that describe the columns of a table, and return their values."""
        from teleop.errors import InputError
        from teleop.evaluation.formats.columns import Wanted

        if self.lever is not None and not self.lever > 0.0:
            raise InputError(f"--lever {self.lever:g} m: expected more than zero, such as 50mm")
        if self.rate is not None and not 1e-3 <= self.rate <= 1e9:
            raise InputError(f"rate {self.rate:g}: expected 0.001 to 1e9 Hz")
        if self.rate is not None and self.time is not None:
            raise InputError("--rate and --time exclude each other: expected one of them")
        return Wanted(**{option: getattr(self, option) for option in Wanted._fields})


Columns = Annotated[ColumnOptions, Parameter(name="*", group=COLUMNS)]
BY_USUAL_NAMES = ColumnOptions()
