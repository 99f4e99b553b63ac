"""Estimates on emulated rigs agree with those on the simulated rig."""

from __future__ import annotations

import numpy as np
import pytest

from sim_backend import Cube, Relaxing, Setup
from teleop.output.report_page import report_page
from teleop.recording.recording import from_columns
from teleop.safety.soft_limits import VELOCITY
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import Layout
from teleop.trial.metadata import session_metadata
from teleop.trial.run import run_trial

SECONDS = 2.0


def final(trial):
    """Return the last estimate of RLS."""
    b, k, *_ = trial.estimates["rls"]
    return b[-1], k[-1]


@pytest.mark.parametrize("name", ["serial-board", "odrive-bota", "cia402-ft300"])
def test_estimates_are_those_of_the_simulated_rig(in_memory, name):
    wired = in_memory(name, duration=SECONDS)
    plain = TrialSettings(
        condition="autonomous",
        clock="virtual",
        rate=wired.settings.loop_rate,
        duration=SECONDS,
        custom_limits=wired.settings.custom_limits,
        force_lag=0.0,  # the rig files state no transmission
        lost_motion=0.0,
    )
    b, k = final(wired.run())
    true_b, true_k = final(run_trial(plain))
    assert k == pytest.approx(true_k, rel=0.05)
    if name == "serial-board":  # sampling times of the others are known to half a tick only
        assert b == pytest.approx(true_b, abs=0.25e-3 * true_k)  # a quarter of a tick


def test_every_limited_tick_is_counted_although_the_force_sensor_is_slower_than_the_loop(in_memory):
    slow = TightenedLimits(max_velocity=0.01)
    trial = in_memory("cia402-ft300", duration=1.0, tightened_limits=slow).run()
    flags = trial.recording["limited"].astype(int)
    summary = trial.summary()
    assert summary["pairs"] < 0.5 * summary["ticks"]
    counted = summary["safety"]["limited_ticks"]["velocity"]
    assert counted == sum((flags & VELOCITY) > 0) > summary["pairs"]


def test_the_target_of_mimic_is_followed_as_on_the_simulated_rig(in_memory):
    wired = in_memory("serial-board", "mimic", duration=4.5, count_in=0.5, depth=5e-3, rate=500.0)
    found = wired.run().summary()["tracking"]
    plain = run_trial(wired.settings).summary()["tracking"]
    assert found["periods"] == plain["periods"] == 3
    assert found["gain"] == pytest.approx(plain["gain"], rel=0.05)
    assert found["delay_s"] == pytest.approx(plain["delay_s"], rel=0.05)


def test_an_observer_in_place_of_the_contact_sensor_gives_the_stiffness(stepped):
    rigid = Setup(Cube(k1=1931.0, k3=2.8e6, b=3.0), 5.4e-3, 11e-3)  # friction is not observed
    trial = stepped("odrive-reaction-force", duration=SECONDS, custom_setup=rigid).run()
    assert trial.fault is None
    assert final(trial)[1] == pytest.approx(2000.0, rel=0.2)


def test_emulated_devices_palpate_a_body_that_relaxes(in_memory):
    body = Relaxing(Cube(2000.0, 1e6, 3.0, glued=False), 3000.0, 0.3)
    setup = Setup(body, 2.66e-3, 6e-3)
    wired = in_memory("serial-board", duration=SECONDS, custom_setup=setup)
    trials = wired.run(), run_trial(wired.settings)
    largest = [max(trial.columns["contact_force"]) for trial in trials]
    assert largest[0] == pytest.approx(largest[1], rel=0.05)
    assert largest[1] > 1.2 * body.slow.force(6e-3, 0.0)


@pytest.mark.parametrize(
    ("name", "channels"), [("odrive-reaction-force", ["contact_force"]), ("serial-board", [])]
)
def test_a_recording_names_the_channels_that_an_observer_estimated(stepped, name, channels):
    metadata = session_metadata(TrialSettings(rig=stepped(name).file))
    schema = Layout({}).schema
    columns = {column.name: np.empty(0) for column in schema.columns}
    recording = from_columns(schema, columns, [], metadata)
    assert recording.estimated_channels == channels
    page = report_page("run.mcap", None, None, recording)
    assert page.count("not measured") == len(channels)
