"""Force-commanded masters and rigs without a handle: what is refused, what a trial does."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.rig_file import RigFileError, parse_rig_file, read_rig_file
from sim_backend import ForceMaster, ForceSlave
from teleop.cli import main
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.settings import FeedbackSettings
from teleop.errors import InputError
from teleop.names import COUPLED, NO_HANDLE
from teleop.recording.recording import load
from teleop.settings.configuration import read_configuration
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

RIGS = Path(__file__).parents[3] / "rigs"
INDENTER = """
name = "indenter"
buses.usb = { kind = "serial", port = "/dev/ttyACM0", baud_bps = 921600 }
[devices.board]
kind = "board"
bus = "usb"
force_n_per_count = [1e-4]
position_um_per_count = [1.0]
velocity_um_per_s_per_count = [1.0]
[channels]
contact_force = { device = "board", signal = "force_0", range_n = [-50, 50] }
slave_position = { device = "board", signal = "position_0", range_mm = [-60, 60] }
[drives]
slave = { device = "board", drive = "axis_0", max_velocity_mm_per_s = 100 }
[limits]
max_velocity_mm_per_s = 100
max_acceleration_m_per_s2 = 10
max_master_velocity_mm_per_s = 100
max_master_acceleration_m_per_s2 = 10
soft_position_mm = [-45, 25]
hard_position_mm = [-50, 30]
soft_force_n = 40
hard_force_n = 50
following_error_mm = 2
"""
TRIAL = TrialSettings(clock="virtual", duration=4.0, estimators=("rls",))


def test_an_indenter_without_a_handle_is_described_in_25_lines(tmp_path):
    assert len(INDENTER.strip().splitlines()) <= 25
    rig = parse_rig_file(tmp_path / "rig.toml", INDENTER)
    settings = TrialSettings(condition="autonomous", rig=rig, depth=5e-3, specimen="gel")
    assert settings.hand_force_source == NO_HANDLE
    with pytest.raises(InputError, match="'indenter' has no handle: expected autonomous"):
        replace(settings, condition="free")


def test_keys_of_forces_are_refused_at_a_drive_that_accepts_velocities(tmp_path):
    wrong = INDENTER.replace(
        "max_velocity_mm_per_s = 100 }", "max_velocity_mm_per_s = 100, max_force_n = 5 }", 1
    )
    with pytest.raises(RigFileError, match=r"max_force_n: the drive accepts velocities"):
        parse_rig_file(tmp_path / "rig.toml", wrong)


def test_a_coupling_that_is_not_passive_is_refused_with_the_largest_stiffness():
    with pytest.raises(InputError, match="6000 N/m: expected at most 1333 N/m"):
        replace(TRIAL, force_master=ForceMaster(6000.0))
    with pytest.raises(InputError, match="expected at most 266 N/m"):
        replace(TRIAL, force_master=ForceMaster(), rate=200.0)


def test_a_coupling_that_the_drive_closes_is_checked_with_the_rate_of_the_drive():
    rig = read_rig_file(RIGS / "mit-motor.toml")
    # With the period of this loop, at most 333 N/m would be passive.
    slow = TrialSettings(rig=rig, rate=250.0, depth=5e-3, specimen="gel")
    assert slow.master_coupling.stiffness == 977.0
    with pytest.raises(InputError, match="700 N/m: expected at most 200 N/m"):
        replace(slow, rig=read_rig_file(RIGS / "odrive-torque.toml"))


def test_a_motor_that_is_too_weak_for_the_feedback_is_refused_with_the_largest_gain():
    weak = replace(TRIAL, force_master=ForceMaster(max_force=20.0))
    with pytest.raises(InputError, match=r"expected a gain of at most 0\.3"):
        replace(weak, feedback=FeedbackSettings("model-mediated"))
    replace(weak, feedback=FeedbackSettings("model-mediated", gain=0.3))


def test_the_hand_feels_the_body_in_series_with_the_coupling():
    settings = replace(
        TRIAL,
        duration=6.0,
        seed=8123,
        force_master=ForceMaster(800.0, max_force=70.0),
        feedback=FeedbackSettings("model-mediated"),
        channel=ChannelSettings(delay=0.05),
    )
    trial = run_trial(settings)
    felt = trial.summary()["feedback"]
    assert felt["stable"]
    assert abs(felt["rendered_k_error"]) < 0.03
    # Two springs in series, with the measured handle as an independent position.
    recording = trial.recording.where(trial.recording["time"] > 3.0)
    part = recording["contact_force"] > 2.0
    k = np.polyfit(recording["slave_position"][part], recording["contact_force"][part], 1)[0]
    handle = recording["master_position"][part]
    at_handle = np.polyfit(handle, recording["drive_force"][part], 1)[0]
    assert at_handle == pytest.approx(1.0 / (1.0 / k + 1.0 / 800.0), rel=0.06)
    assert felt["rendered_k"] == pytest.approx(at_handle, rel=0.1)


def test_the_force_of_the_hand_is_that_of_the_coupling_and_the_source_is_recorded(tmp_path, capsys):
    path = tmp_path / "trial.mcap"
    options = (
        "--clock=virtual",
        "--duration=2",
        "--estimators=rls",
        "--force-master=stiffness=600",
    )
    assert main(["run", *options, f"--record={path}", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["hand_force"] == COUPLED
    recording = load(path)
    assert recording.session["hand_force"] == COUPLED
    assert np.nanmax(np.abs(recording["master_force"])) > 0.2


def test_wrong_values_of_the_force_master_are_one_line(capsys):
    assert main(["run", "--clock=virtual", "--no-record", "--force-master=stiffness=x"]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "max_force" in message


def test_a_force_slave_is_checked_and_recorded(tmp_path, capsys):
    path = tmp_path / "trial.mcap"
    options = ("--clock=virtual", "--duration=3", "--estimators=rls", "--force-slave=latency=2")
    assert main(["run", *options, f"--record={path}", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["estimates"]["rls"]["k"] == pytest.approx(2000.0, rel=0.1)
    recorded = read_configuration(path)
    assert recorded.force_slave == ForceSlave(latency=2)
    # The loop yields to the contact force by 1 / K.
    assert recorded.limits.drive_compliance == pytest.approx(34e-6, rel=0.05)


@pytest.mark.parametrize(
    ("slave", "message"),
    [
        (ForceSlave(12.0), "force_slave.mass 12 kg: .* unstable .* expected about 3 kg"),
        (ForceSlave(max_force=40.0), "force_slave.max_force 40 N: expected at least the soft"),
    ],
)
def test_a_force_slave_that_cannot_work_is_refused(slave, message):
    with pytest.raises(InputError, match=message):
        replace(TRIAL, force_slave=slave)


def test_a_force_slave_of_a_hardware_rig_is_described_in_the_rig_file():
    rig = read_rig_file(RIGS / "odrive-torque.toml")
    with pytest.raises(InputError, match=r"force_slave: .* expected \[drives.slave\]"):
        TrialSettings(rig=rig, depth=5e-3, specimen="gel", force_slave=ForceSlave())
    weak = rig.text.replace("max_force_n = 250", "max_force_n = 150")
    weak_rig = parse_rig_file(RIGS / "weak.toml", weak)
    with pytest.raises(InputError, match="drives.slave.max_force_n 150 N: expected at least"):
        TrialSettings(rig=weak_rig, depth=5e-3, specimen="gel")


def test_the_check_of_position_force_includes_the_lag_of_the_slave(tmp_path):
    from teleop.settings.feedback_checks import crossing_time, lag, sensor_lag

    rest = lag(TRIAL) - crossing_time(TRIAL)
    assert rest == pytest.approx(sensor_lag(TRIAL) + 1.0 / (2.0 * math.pi * 80.0) + 1.5e-3)
    coupled = replace(TRIAL, force_master=ForceMaster(latency=1))
    assert lag(coupled) == pytest.approx(lag(TRIAL) + 3e-3)
