"""The observer of an oscillation that the loop sustains at the hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sim_backend import OperatorModel, Transmission
from teleop.control.admittance import AdmittanceParameters
from teleop.control.bilateral import BilateralLink
from teleop.control.channel import ChannelSettings
from teleop.control.feedback import oscillation
from teleop.control.feedback.oscillation import MEMORY, MOST_SHARE, Oscillation
from teleop.control.feedback.settings import FeedbackSettings
from teleop.evaluation.teleoperation import thresholds
from teleop.safety import Fault
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_link
from teleop.trial.run import run_trial

SECONDS = MEMORY + 2.0
FREQUENCIES = st.floats(7.0, 40.0)
FEW = settings(max_examples=25)


def sine(frequency, impedance, speed=10e-3, dt=1e-3):
    """Return velocity and force of a sine against an impedance [N s/m], at each tick."""
    time = np.arange(0.0, SECONDS, dt)
    velocity = np.sqrt(2.0) * speed * np.exp(2j * np.pi * frequency * time)
    return velocity.real, (impedance * velocity).real


def largest(velocity, force, dt=1e-3):
    """Return the largest share that the observer finds."""
    observer = Oscillation()
    position = np.cumsum(velocity * dt)
    return max(
        observer.update(f, x, dt) for x, f in zip(position.tolist(), force.tolist(), strict=True)
    )


@FEW
@given(
    FREQUENCIES, st.floats(5.0, 50.0), st.floats(0.0, 1500.0), st.sampled_from([5e-4, 1e-3, 2e-3])
)
def test_motion_against_an_arm_at_rest_is_found(frequency, damping, stiffness, dt):
    arm = damping - 1j * stiffness / (2.0 * np.pi * frequency)
    velocity, force = sine(frequency, -arm, dt=dt)
    assert largest(velocity, force, dt) > MOST_SHARE


@FEW
@given(FREQUENCIES, st.floats(0.0, 2.0), st.floats(5.0, 200.0), st.floats(0.0, 2e4))
@example(frequency=10.0, mass=0.0, damping=5.0, stiffness=2e4)
def test_tremor_that_moves_a_passive_impedance_is_not_found(frequency, mass, damping, stiffness):
    omega = 2.0 * np.pi * frequency
    impedance = damping + 1j * (mass * omega - stiffness / omega)
    assert largest(*sine(frequency, impedance)) < 0.3


def test_tremor_that_the_environment_amplifies_less_than_an_arm_dissipates_is_not_found():
    assert largest(*sine(10.0, -1.0)) < 0.1


def test_an_oscillation_is_found_while_the_tremor_gives_more_power_to_a_stiff_contact():
    """On the hard cube, the tremor moves an impedance of about 100 N s/m."""
    velocity, force = (
        a + b for a, b in zip(sine(35.0, -6.0, 3e-3), sine(10.0, 150.0, 0.8e-3), strict=True)
    )
    assert np.mean(force * velocity) > 0.0
    assert largest(velocity, force) > MOST_SHARE


def test_an_oscillation_that_pauses_between_pokes_is_found():
    velocity, force = sine(35.0, -8.0)
    pause = np.arange(len(velocity)) % 1500 > 500
    assert largest(np.where(pause, 0.0, velocity), np.where(pause, 0.0, force)) > MOST_SHARE


def test_fast_pokes_that_an_elastic_body_drives_back_are_not_found():
    """Half sines of 0.1 s: the body gives back the energy that the hand gave to it."""
    phase = np.arange(0.0, SECONDS, 1e-3) % 0.5 / 0.1
    depth = np.where(phase < 1.0, 2e-3 * np.sin(np.pi * phase) ** 2, 0.0)
    velocity = np.gradient(depth, 1e-3)
    assert largest(velocity, 2000.0 * depth + 15.0 * velocity) < 0.3


def test_slow_motion_and_motion_below_the_least_speed_are_not_found():
    assert largest(*sine(1.0, -15.0)) < 0.1
    assert largest(*sine(20.0, -15.0, speed=0.9e-3)) == 0.0


def test_supervisor_and_evaluation_have_the_same_definition_of_an_oscillation():
    assert oscillation.SLOWEST == thresholds.FASTEST_HAND
    assert oscillation.LEAST_DAMPING == thresholds.LEAST_DAMPING
    assert MEMORY == thresholds.SETTLING


RIGID = replace(TrialSettings(cube="hard").setup, transmission=Transmission())
SETTINGS = TrialSettings(
    cube="hard",
    custom_setup=RIGID,
    clock="virtual",
    duration=10.0,
    estimators=("rls",),
    feedback=FeedbackSettings("position-force"),
    operator_model=OperatorModel(400.0, 10.0),
    tightened_limits=TightenedLimits(soft_force=20.0, hard_force=40.0),
)


@pytest.mark.parametrize("damping", [15.0, 50.0])
def test_position_force_on_the_hard_cube_ends_in_a_stop_by_the_oscillation(damping):
    result = run_trial(replace(SETTINGS, admittance=AdmittanceParameters(damping=damping)))
    assert result.fault["fault"] == Fault.OSCILLATION
    assert "the loop sustains" in result.fault["text"]
    assert MEMORY <= result.fault["time"] < MEMORY + 1.0
    assert not result.feedback()["stable"]
    assert np.max(np.abs(result.recording["contact_force"])) < 40.0


@pytest.mark.parametrize("law", ["none", "position-force", "model-mediated"])
def test_only_a_law_that_displays_the_slave_is_observed(law):
    trial = replace(SETTINGS, feedback=FeedbackSettings(law), channel=ChannelSettings(0.01))
    link = make_link(trial)
    assert isinstance(link, BilateralLink)
    assert (link._master._oscillation is None) == (law == "none")


def test_the_observer_begins_again_when_the_drives_are_armed():
    observer = Oscillation()
    velocity, force = sine(20.0, -15.0)
    position = np.cumsum(velocity * 1e-3)
    for x, f in zip(position.tolist(), force.tolist(), strict=True):
        observer.update(f, x, 1e-3)
    assert observer.share > MOST_SHARE
    observer.reset(0.0)
    assert observer.share == 0.0
    assert vars(observer).keys() == vars(Oscillation()).keys()
    assert observer.update(force[-1], position[-1], 5e-3) == 0.0
