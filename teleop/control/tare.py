"""Tare: the zeros of force and position, their file, and their use on measurements."""

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
"""Largest force that is accepted as the zero of a sensor [N]; beyond it the sensor is loaded."""
FARTHEST = 1.0
"""Greatest position that is accepted as a datum [m]."""
LONGEST_TEXT = 1000
"""Longest date or name of a rig that is accepted, in characters."""


@dataclass(frozen=True)
class Tare:
    """Zeros of the channels, subtracted from every measurement."""

    master_force: float = 0.0
    """Reading of the handle's force sensor at no force [N]."""
    contact_force: float = 0.0
    """Reading of the contact force sensor at no force [N]."""
    slave_position: float = 0.0
    """Reading of the slave's encoder where contact begins, the contact datum [m]."""
    date: str = ""
    """Date of the measurement, ISO 8601."""
    rig: str = ""
    """Name of the rig; empty if it is not known."""

    @property
    def zeros(self) -> dict[str, float]:
        """Zeros other than 0, by channel, in SI units."""
        return {name: value for name, value in asdict(self).items() if name in CHANNELS and value}

    def apply(self, measurement: Measurement) -> Measurement:
        """Return the measurement relative to these zeros."""
        return measurement._replace(
            master_force=measurement.master_force - self.master_force,
            contact_force=measurement.contact_force - self.contact_force,
            slave_position=measurement.slave_position - self.slave_position,
        )

    def check(self, rig: str) -> None:
        """Refuse zeros that are out of range, and those of another rig.

        Parameters
        ----------
        rig
            Name of the rig that they are to be applied to.

        Raises
        ------
        InputError
            A force or a position is too large to be a zero, or is no number, or the zeros were
            found on another rig.
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
                f"tare: it was found on the rig {self.rig!r}: expected one of {rig!r}, as "
                "teleop rig tare finds it"
            )


NO_TARE = Tare()


def write_tare(tare: Tare, path: Path, overwrite: bool = False) -> None:
    """Store zeros; InputError if the file cannot be written, or exists without `overwrite`."""
    write_text(path, dumps(asdict(tare), indent=2) + "\n", overwrite)


def read_tare(path: Path) -> Tare:
    """Return the zeros in a file of `teleop rig tare`.

    Files of teleop 0.1 name no rig.

    Raises
    ------
    InputError
        The file cannot be read, or its content is not as expected.
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
