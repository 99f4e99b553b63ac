"""Tare: zero offsets of the force sensors and of the slave position.

The zero offsets are subtracted from each measurement. This file reads, checks and writes them.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from drivers import CHANNELS, UNITS, Measurement
from drivers.input_file import read_input
from teleop.errors import InputError, invalid_parts
from teleop.files import unreadable, write_text
from teleop.json_documents import dumps

LARGEST_ZERO = 15.0
"""Largest accepted zero offset of a force sensor [N]. A larger value indicates a loaded sensor."""
FARTHEST = 1.0
"""Largest accepted magnitude of the slave position at which contact begins [m]."""
LONGEST_TEXT = 1000
"""Largest number of characters of the date and of the rig's name in a tare file."""


@dataclass(frozen=True)
class Tare:
    """Zero offsets, which are subtracted from every measurement.

    A zero offset is the reading of a sensor when the measured quantity is zero.
    """

    master_force: float = 0.0
    """Reading of the handle's force sensor without load [N]."""
    contact_force: float = 0.0
    """Reading of the contact force sensor without load [N]."""
    slave_position: float = 0.0
    """Reading of the slave's encoder when contact begins: the contact datum [m]."""
    date: str = ""
    """Date of the measurement, ISO 8601."""
    rig: str = ""
    """Name of the rig on which the zero offsets were measured; empty if unknown."""

    @property
    def zeros(self) -> dict[str, float]:
        """Zero offsets that are not 0, in SI units.

        The keys are the names of the channels, for example `contact_force`.
        """
        return {name: value for name, value in asdict(self).items() if name in CHANNELS and value}

    def apply(self, measurement: Measurement) -> Measurement:
        """Return a copy of a measurement from which the zero offsets are subtracted."""
        return measurement._replace(
            master_force=measurement.master_force - self.master_force,
            contact_force=measurement.contact_force - self.contact_force,
            slave_position=measurement.slave_position - self.slave_position,
        )

    def check(self, rig: str) -> None:
        """Check that the zero offsets are plausible and were measured on the given rig.

        It raises InputError if an offset is NaN or too large, or was measured on another rig.
        """
        for name, value, most in (
            ("master_force", self.master_force, LARGEST_ZERO),
            ("contact_force", self.contact_force, LARGEST_ZERO),
            ("slave_position", self.slave_position, FARTHEST),
        ):
            unit = UNITS[name]
            if not abs(value) <= most:
                raise InputError(
                    f"tare: {name} {value:g} {unit}: expected a zero within {most:g} {unit}"
                )
        if self.rig and self.rig != rig:
            raise InputError(
                f"tare: measured on the rig {self.rig!r}: expected a tare of the rig {rig!r}, "
                "from teleop rig tare"
            )


NO_TARE = Tare()


def write_tare(tare: Tare, path: Path, overwrite: bool = False) -> None:
    """Write the zero offsets to a JSON file."""
    write_text(path, dumps(asdict(tare), indent=2) + "\n", overwrite)


def read_tare(path: Path) -> Tare:
    """Read the zero offsets from a file that the command `teleop rig tare` wrote.

    Version 0.1 of teleop did not write the name of the rig to the file. For such a file, `Tare.rig`
    is empty.
    """
    from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

    force, position = Field(ge=-LARGEST_ZERO, le=LARGEST_ZERO), Field(ge=-FARTHEST, le=FARTHEST)

    class File(BaseModel):
        model_config = ConfigDict(extra="forbid", strict=True)

        master_force: Annotated[FiniteFloat, force]
        contact_force: Annotated[FiniteFloat, force]
        slave_position: Annotated[FiniteFloat, position]
        date: Annotated[str, Field(max_length=LONGEST_TEXT)]
        rig: Annotated[str, Field(max_length=LONGEST_TEXT)] = ""

    try:
        return Tare(**File.model_validate_json(read_input(path)).model_dump())
    except OSError as error:
        raise unreadable(path, error) from error
    except ValidationError as error:
        raise InputError(
            f"{path}: expected a file of teleop rig tare: {invalid_parts(error)}"
        ) from error
