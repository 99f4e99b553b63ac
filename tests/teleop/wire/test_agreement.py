"""The wire changes nothing that matters: estimates over it are those without it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.rig_file import read_rig_file
from teleop.settings import TrialSettings
from teleop.trial import run_trial

SECONDS = 2.5


def final(trial):
    """RLS's last estimate."""
    b, k = trial.estimates["rls"]
    return b[-1], k[-1]


@pytest.mark.parametrize("name", ["serial-board", "odrive-bota", "cia402-ft300"])
def test_estimates_are_those_of_the_simulated_rig(stepped, name):
    settings = stepped(name, duration=SECONDS)
    plain = TrialSettings(
        condition="autonomous",
        clock="virtual",
        rate=settings.rate,
        duration=SECONDS,
        custom_limits=settings.custom_limits,
    )
    b, k = final(run_trial(settings))
    true_b, true_k = final(run_trial(plain))
    assert k == pytest.approx(true_k, rel=0.05)
    if name == "serial-board":  # the others' samples are dated to half a tick, emulated in steps
        assert b == pytest.approx(true_b, rel=0.05)


def test_an_observer_in_place_of_the_contact_sensor_is_marked_in_the_recording(stepped):
    settings = stepped("odrive-reaction-force", duration=SECONDS)
    settings = replace(settings, rig=None)
    trial = run_trial(settings)
    assert trial.fault is None
    assert final(trial)[1] == pytest.approx(2000.0, rel=0.2)


def test_a_recording_names_the_channels_that_an_observer_estimated(stepped, tmp_path):
    from teleop.trial import estimated_channels

    file = stepped("odrive-reaction-force").file
    assert list(estimated_channels(TrialSettings(rig=file))) == ["contact_force"]
    board = read_rig_file(file.path.with_name("serial-board.toml"))
    assert list(estimated_channels(TrialSettings(rig=board))) == []
