"""An excitation that is chosen while it runs: smooth, within the limits, and with its reason."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from sim_backend import paper_setup
from teleop.cli import main
from teleop.control.designed_excitation import Motion, Transition
from teleop.control.excitation_signals import Designed
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

STEP = 1e-4
"""Step of the numerical derivatives [s]."""
SETTINGS = TrialSettings(
    condition="autonomous", signal=Designed(), clock="virtual", duration=3.2, estimators=("rls",)
)


def test_a_change_of_motion_is_smooth_and_its_derivatives_are_right():
    before, after = Motion(3e-3, 2e-3, 12.0), Motion(5e-3, 4e-3, 25.0)
    change = Transition(1.0, 0.4, before, after, 0.7)
    t = np.arange(1.0, 2.0, 1e-3)
    x, v, a = (np.array([change.at(s + d) for s in t]).T for d in (-STEP, 0.0, STEP))
    np.testing.assert_allclose((a[0] - x[0]) / (2.0 * STEP), v[1], atol=2e-5)
    np.testing.assert_allclose((a[1] - x[1]) / (2.0 * STEP), v[2], atol=5e-3)
    assert np.abs(np.diff(v[2])).max() < 0.2  # the acceleration does not jump
    assert v[0][0] == pytest.approx(3e-3 + 2e-3 * math.sin(0.7))
    late = change.at(1.7)
    assert (late.value - 5e-3) ** 2 + (late.rate / 25.0) ** 2 == pytest.approx(4e-3**2)


def reached(trial):
    """Return the largest depth, speed and contact force of a trial."""
    recording, columns = trial.recording, ("slave_position", "slave_velocity", "contact_force")
    return [float(np.nanmax(np.abs(recording[name]))) for name in columns]


@pytest.mark.parametrize("cube", ["soft", "hard"])
def test_the_motion_becomes_deep_and_fast_within_the_limits(cube):
    settings = replace(SETTINGS, cube=cube)
    trial, limits = run_trial(settings), settings.limits
    depth, speed, force = reached(trial)
    assert 0.8 * settings.setup.depth < depth < 1.02 * settings.setup.depth
    assert speed < 0.97 * limits.max_velocity
    assert force < limits.soft_force
    assert not any(trial.statistics.limited.values())
    first, *choices = [choice["text"] for choice in trial.summary()["choices"]]
    assert first.startswith("pilot: 4 Hz")
    assert all("halve the part of the noise in the interval of" in text for text in choices)
    assert choices


def test_a_force_limit_restricts_the_depth_also_of_a_body_that_stiffens():
    setup = paper_setup("injector", "medium")
    limits = replace(TrialSettings(condition="autonomous", cube="medium").limits, soft_force=14.0)
    trial = run_trial(replace(SETTINGS, cube="medium", custom_limits=limits))
    depth, _, force = reached(trial)
    assert depth < 0.9 * setup.depth  # 22 N at the full depth
    assert force < limits.soft_force
    assert not any(trial.statistics.limited.values())


def test_a_speed_limit_restricts_the_frequency():
    limits = replace(TrialSettings(condition="autonomous").limits, max_velocity=0.05)
    trial = run_trial(replace(SETTINGS, custom_limits=limits))
    _, speed, _ = reached(trial)
    assert speed < 0.05
    assert not trial.statistics.limited["velocity"]


def test_the_command_states_the_choices(capsys):
    command = ["run", "--clock", "virtual", "--condition", "autonomous", "--signal", "designed"]
    assert main([*command, "--frequency", "3", "--duration", "2.1", "--no-record"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "at 0.0 s, pilot: 3 Hz, ± " in shown
    assert "at 1.0 s, 3 Hz, ± " in shown
    assert main([*command, "--duration", "2.1", "--no-record", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["choices"][0]["time_s"] == pytest.approx(0.0)


def test_only_the_controller_can_follow_a_designed_excitation(capsys):
    assert main(["run", "--condition", "free", "--signal", "designed", "--json"]) == 2
    assert "signal designed: not in free" in capsys.readouterr().err
