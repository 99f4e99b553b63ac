"""Where force and position are zero: found with nothing loaded, stored with its date, applied."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from drivers import Measurement
from drivers.input_file import read_input
from teleop.errors import InputError
from teleop.files import unreadable, write_text

if TYPE_CHECKING:
    from pydantic import ValidationError


class Tare(NamedTuple):
    """Zeros of the channels, taken off every measurement."""

    master_force: float = 0.0
    """What the handle's force sensor reads at no force [N]."""
    contact_force: float = 0.0
    """What the contact force sensor reads at no force [N]."""
    slave_position: float = 0.0
    """What the slave's encoder reads where contact begins, the contact datum [m]."""
    date: str = ""
    """When it was found, ISO 8601."""

    def apply(self, measurement: Measurement) -> Measurement:
        """The measurement from these zeros."""
        return measurement._replace(
            master_force=measurement.master_force - self.master_force,
            contact_force=measurement.contact_force - self.contact_force,
            slave_position=measurement.slave_position - self.slave_position,
        )


NO_TARE = Tare()


def write_tare(tare: Tare, path: Path, overwrite: bool = False) -> None:
    """Store zeros; InputError if the file cannot be written, or is there and not to be replaced."""
    write_text(path, json.dumps(tare._asdict(), indent=2) + "\n", overwrite)


def read_tare(path: Path) -> Tare:
    """The zeros in a file of `teleop rig tare`.

    Raises
    ------
    InputError
        The file cannot be read, or is not as expected.
    """
    from pydantic import BaseModel, FiniteFloat, ValidationError

    class File(BaseModel, extra="forbid"):
        master_force: FiniteFloat
        contact_force: FiniteFloat
        slave_position: FiniteFloat
        date: str

    try:
        return Tare(**File.model_validate_json(read_input(path)).model_dump())
    except OSError as error:
        raise unreadable(path, error) from error
    except ValidationError as error:
        raise InputError(
            f"{path}: expected a file of teleop rig tare: {problems(error)}"
        ) from error


def problems(error: ValidationError) -> str:
    """All that is wrong with a file, on one line."""
    return "; ".join(
        f"{'.'.join(map(str, e['loc'])) or 'file'}: {e['msg'].lower()}" for e in error.errors()
    )
