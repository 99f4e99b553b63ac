"""The calibrated transmission of a rig: in its rig file, and of the simulated rig."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from estimation.transmission import RIGID, TransmissionCalibration
from sim_backend import Transmission
from teleop.errors import InputError
from teleop.rig.force_lag import measure_simulated_lag
from teleop.settings.rig_loading import load_rig_file
from teleop.settings.transmission_file import (
    read_transmission,
    simulated_transmission,
    write_transmission,
)
from teleop.settings.trial_settings import TrialSettings

BOARD = Path(__file__).parents[3] / "rigs" / "serial-board.toml"
SECTION = """
[transmission]
lag_ms = 2.5
lost_motion_um = 80.0
lost_motion_error_um = 1.5
"""


def on_hardware(path, text):
    path.write_text(BOARD.read_text(encoding="utf-8") + text)
    return TrialSettings(rig=load_rig_file(path), specimen="gel", depth=3e-3)


def test_a_trial_has_the_transmission_of_its_rig_file(tmp_path):
    assert on_hardware(tmp_path / "rig.toml", "").transmission == RIGID
    found = on_hardware(tmp_path / "rig.toml", SECTION).transmission
    assert (found.force_lag, found.compliance, found.lost_motion_error) == (2.5e-3, 0.0, 1.5e-6)
    assert found.lost_motion == pytest.approx(80e-6, rel=1e-12)


def test_a_wrong_value_in_the_section_is_refused_with_its_key(tmp_path):
    with pytest.raises(InputError, match=r"transmission\.lost_motion_um"):
        on_hardware(tmp_path / "rig.toml", SECTION.replace("80.0", "-80.0"))


def test_the_simulated_rig_has_the_values_that_teleop_lag_measures():
    stored = simulated_transmission()
    measured = measure_simulated_lag(seed=731)[0].calibration(5000.0)
    for name in ("force_lag", "lost_motion", "compliance"):
        error = getattr(stored, f"{name}_error") + getattr(measured, f"{name}_error")
        assert abs(getattr(stored, name) - getattr(measured, name)) <= error
    assert TrialSettings().transmission == stored


def test_another_transmission_of_the_simulated_rig_is_unknown():
    setup = replace(TrialSettings().setup, transmission=Transmission(50e-6, 4e-6))
    assert TrialSettings(custom_setup=setup).transmission == RIGID


def test_a_transmission_file_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "transmission.toml"
    written = TransmissionCalibration(2.5e-3, 80e-6, 7e-6, 1e-5, 1.5e-6, 2e-8)
    write_transmission(written, "Measured on a spring", path, overwrite=False)
    found = read_transmission(path)
    for name, value in vars(written).items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-12)
    with pytest.raises(InputError, match=str(path)):
        write_transmission(written, "Measured again", path, overwrite=False)
