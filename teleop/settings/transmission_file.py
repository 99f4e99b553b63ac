"""Read and write the calibrated transmission of a rig, a TOML file of `teleop lag --out`.

A rig file has the same keys in its section `[transmission]`.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from pathlib import Path

from pydantic import ValidationError

from drivers.input_file import read_input
from drivers.rig_sections import TransmissionSettings
from estimation.transmission import TransmissionCalibration
from teleop.errors import InputError, invalid_parts
from teleop.files import unreadable, write_text

SIMULATED = "simulated_transmission.toml"
"""File in this folder with the transmission of the simulated rig, as measured on a spring."""


def calibration(section: TransmissionSettings) -> TransmissionCalibration:
    """Convert the values of a file to SI units."""
    return TransmissionCalibration(
        force_lag=section.lag_ms * 1e-3,
        lost_motion=section.lost_motion_um * 1e-6,
        compliance=section.compliance_um_per_n * 1e-6,
        force_lag_error=section.lag_error_ms * 1e-3,
        lost_motion_error=section.lost_motion_error_um * 1e-6,
        compliance_error=section.compliance_error_um_per_n * 1e-6,
        delay_share=section.delay_share,
        delay_share_error=section.delay_share_error,
        lag_lost_motion_correlation=section.lag_lost_motion_correlation,
    )


def read_transmission(path: Path) -> TransmissionCalibration:
    """Read a transmission file.

    Raises InputError if the file cannot be read, is not TOML, or has wrong keys or values.
    """
    try:
        text = read_input(path).decode()
    except OSError as error:
        raise unreadable(path, error) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a TOML file: expected UTF-8") from error
    return parsed(text, str(path))


def parsed(text: str, place: str) -> TransmissionCalibration:
    """Return the values in the text of a transmission file."""
    try:
        return calibration(TransmissionSettings.model_validate(tomllib.loads(text)))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{place}: not a TOML file: {error}") from error
    except ValidationError as error:
        raise InputError(f"{place}: {invalid_parts(error)}") from error


@cache
def simulated_transmission() -> TransmissionCalibration:
    """Return the transmission of the simulated rig, as `teleop lag` measured it on a spring."""
    return parsed((files("teleop.settings") / SIMULATED).read_text(encoding="utf-8"), SIMULATED)


def write_transmission(
    measured: TransmissionCalibration, origin: str, path: Path, overwrite: bool
) -> None:
    """Write a transmission file; `origin` states in a comment how the values were measured."""
    write_text(path, transmission_text(measured, origin), overwrite)


def transmission_text(measured: TransmissionCalibration, origin: str) -> str:
    """Return the content of a transmission file, in the units of its keys."""
    values = (
        ("lag_ms", measured.force_lag, 1e3),
        ("lag_error_ms", measured.force_lag_error, 1e3),
        ("delay_share", measured.delay_share, 1.0),
        ("delay_share_error", measured.delay_share_error, 1.0),
        ("lost_motion_um", measured.lost_motion, 1e6),
        ("lost_motion_error_um", measured.lost_motion_error, 1e6),
        ("lag_lost_motion_correlation", measured.lag_lost_motion_correlation, 1.0),
        ("compliance_um_per_n", measured.compliance, 1e6),
        ("compliance_error_um_per_n", measured.compliance_error, 1e6),
    )
    lines = [
        f"{key} = {round(float(f'{value * factor:.4g}'), 9)}\n" for key, value, factor in values
    ]
    return f"# {origin}. An error is the half width of a 95 % interval.\n" + "".join(lines)
