"""What the hand felt in a trial: oscillation or tremor, and the comparison of the same motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backend import CUBES, OperatorModel, Setup, operators
from sim_backend.channel import ChannelSettings
from teleop.control import bilateral
from teleop.control.admittance import AdmittanceParameters
from teleop.control.feedback import oscillation
from teleop.control.feedback.settings import FeedbackSettings
from teleop.evaluation.rendering import (
    FASTEST,
    LEAST_DAMPING,
    MOST_SUSTAINED,
    hand,
    sustained_share,
)
from teleop.safety.events import ACTIVE
from teleop.safety.tightened_limits import TightenedLimits
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

STEP = 1e-3
TIME = np.arange(0.0, 4.0, STEP)


def trial(law, cube, arm=400.0, seed=0, channel=None, glued=True, damping=15.0):
    settings = TrialSettings(
        cube=cube,
        clock="virtual",
        duration=10.0,
        seed=seed,
        estimators=("rls",),
        feedback=FeedbackSettings(law),
        channel=channel,
        admittance=AdmittanceParameters(damping=damping),
        operator_model=OperatorModel(arm, 10.0, 0.5 if glued else -0.2),
        tightened_limits=TightenedLimits(soft_force=20.0, hard_force=40.0),
    )
    setup = settings.setup
    body = replace(CUBES[cube], glued=glued)
    return run_trial(replace(settings, custom_setup=Setup(body, setup.force_lag, setup.depth)))


def response(impedance, omega):
    """Return velocity and force of a sine of 1 mm/s against an impedance [N s/m]."""
    velocity = 1e-3 * np.exp(1j * omega * TIME)
    return velocity.real, (impedance * velocity).real


def share(velocity, force):
    return sustained_share(velocity, force, np.full(len(velocity), STEP))


@given(
    frequency=st.floats(6.0, 40.0),
    mass=st.floats(0.0, 2.0),
    damping=st.floats(1.0, 200.0),
    stiffness=st.floats(0.0, 2e4),
)
def test_tremor_that_moves_a_passive_impedance_is_not_an_oscillation_of_the_loop(
    frequency, mass, damping, stiffness
):
    omega = 2.0 * np.pi * frequency
    impedance = damping + 1j * (mass * omega - stiffness / omega)
    velocity, force = response(impedance, omega)
    assert share(velocity, force) < 0.05


@given(
    frequency=st.floats(6.0, 40.0),
    damping=st.floats(3.0, 50.0),
    stiffness=st.floats(0.0, 1500.0),
)
def test_motion_against_an_arm_at_rest_is_an_oscillation_of_the_loop(frequency, damping, stiffness):
    omega = 2.0 * np.pi * frequency
    velocity, force = response(damping - 1j * stiffness / omega, omega)
    assert share(velocity, -force) > 0.95


def test_tremor_that_is_amplified_by_less_than_an_arm_dissipates_is_not_an_oscillation():
    velocity, force = response(-1.0, 2.0 * np.pi * 10.0)
    assert share(velocity, force) == 0.0


def test_slow_motion_is_not_an_oscillation():
    velocity, force = response(15.0, 2.0 * np.pi * 1.0)
    assert share(velocity, -force) < 0.05


def test_a_signal_that_is_shorter_than_a_segment_is_evaluated():
    velocity, force = response(15.0, 2.0 * np.pi * 10.0)
    assert share(velocity[:500], -force[:500]) > 0.95
    assert share(velocity[:0], force[:0]) == 0.0


def test_the_tremor_of_a_stiff_arm_is_not_counted_as_unstable():
    assert trial("model-mediated", "soft", arm=1500.0, seed=2).feedback()["stable"]


@pytest.mark.parametrize("tremor", [0.0, operators.TREMOR_AMPLITUDE])
def test_an_oscillation_without_a_stop_is_counted_as_unstable_with_and_without_tremor(
    monkeypatch, tremor
):
    monkeypatch.setattr(operators, "TREMOR_AMPLITUDE", tremor)
    monkeypatch.setattr(bilateral, "MOST_SHARE", np.inf)
    result = trial("position-force", "hard", arm=150.0)
    assert result.fault is None
    assert not result.feedback()["stable"]
    active = result.recording.where(result.recording["mode"] == ACTIVE)
    felt = hand(active, 0.5, 15.0, 0.0)
    found = sustained_share(felt.velocity, active["drive_force"], active["dt"])
    assert found > MOST_SUSTAINED


def test_stiffness_at_hand_and_slave_is_that_of_the_same_motion():
    """A window of the same time has the deep first poke in the motion of the slave only."""
    result = trial("model-mediated", "hard", arm=150.0, channel=ChannelSettings(0.25, 0.02, 0.05))
    assert abs(result.feedback()["rendered_k_error"]) < 0.02


def test_the_position_of_the_hand_does_not_drift_where_a_limit_reduced_the_velocity():
    result = trial("model-mediated", "hard", glued=False)
    active = result.recording.where(result.recording["mode"] == ACTIVE)
    moved = active["commanded_master_velocity"] != active["desired_master_velocity"]
    assert np.count_nonzero(moved) > 100
    felt = hand(active, 0.5, 15.0, 0.0)
    k, k3 = active["model_stiffness"], active["model_stiffening"]
    deep = ~moved & (felt.position > 1e-4)
    force = (k * felt.position + k3 * felt.position**3)[deep]
    assert np.max(np.abs(force - active["displayed_force"][deep])) < 0.5
    assert abs(result.feedback()["rendered_k_error"]) < 0.01


def test_the_supervisor_and_the_evaluation_mean_the_same_by_an_oscillation():
    assert FASTEST == oscillation.SLOWEST
    assert LEAST_DAMPING == oscillation.LEAST_DAMPING
