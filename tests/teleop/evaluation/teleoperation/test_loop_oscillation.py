"""Whether a recorded oscillation is tremor of the hand or an oscillation of the loop."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backend import operators
from teleop.control import sides
from teleop.control.channel import ChannelSettings
from teleop.evaluation.teleoperation.loop_oscillation import RunningSpectra, loop_oscillation
from teleop.evaluation.teleoperation.rendering import hand
from teleop.evaluation.teleoperation.thresholds import LEAST_DAMPING, SUSTAINING
from teleop.safety.events import ACTIVE
from teleop.settings.feedback_checks import arm_damping
from teleop.trial.run import run_trial

STEP = 1e-3
TIME = np.arange(0.0, 4.0, STEP)


def response(impedance, omega):
    """Return velocity and force of a sine of 1 mm/s against an impedance [N s/m]."""
    velocity = 1e-3 * np.exp(1j * omega * TIME)
    return velocity.real, (impedance * velocity).real


def share(velocity, force, arm=None):
    return loop_oscillation(velocity, force, np.full(len(velocity), STEP), arm).share


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


@given(
    frequency=st.integers(6, 40),
    damping=st.floats(4.0, 50.0),
    ratio=st.floats(0.05, 2.0).filter(lambda ratio: abs(ratio - SUSTAINING) > 0.01),
)
def test_with_a_known_arm_motion_counts_if_the_loop_replaces_most_of_what_the_arm_dissipates(
    frequency, damping, ratio
):
    velocity, force = response(-ratio * damping, 2.0 * np.pi * frequency)
    found = share(velocity, force, lambda f: np.full_like(f, damping))
    counts = ratio > SUSTAINING and ratio * damping > LEAST_DAMPING
    assert found > 0.95 if counts else found < 0.05


def test_amplified_tremor_of_a_stable_loop_is_not_an_oscillation_if_the_arm_is_known(
    feedback_settings,
):
    settings = feedback_settings("position-force", "soft", 1500.0, 1, ChannelSettings(4e-3))
    result = run_trial(settings)
    assert result.fault is None
    active = result.recording.where(result.recording["mode"] == ACTIVE)
    velocity = hand(active, 0.5, 15.0, 0.0).velocity
    part = active["time"] > 4.0
    motion = velocity[part], active["drive_force"][part], active["dt"][part]
    assert loop_oscillation(*motion).share > 0.8
    assert loop_oscillation(*motion, partial(arm_damping, settings)).share < 0.1
    assert result.feedback()["stable"]


@given(frequency=st.integers(7, 40), amplitude=st.floats(1e-6, 1e-3))
def test_the_amplitude_and_the_frequency_are_those_of_the_sine(frequency, amplitude):
    omega = 2.0 * np.pi * frequency
    velocity = amplitude * omega * np.cos(omega * TIME)
    found = loop_oscillation(velocity, -15.0 * velocity, np.full(len(TIME), STEP))
    assert found.amplitude == pytest.approx(amplitude, rel=0.02)
    assert found.frequency == pytest.approx(frequency, abs=1.01)
    assert found.tremor < 0.05 * amplitude


def test_slow_motion_is_not_an_oscillation():
    velocity, force = response(15.0, 2.0 * np.pi * 1.0)
    assert share(velocity, -force) < 0.05


def test_a_signal_that_is_shorter_than_a_segment_is_evaluated():
    velocity, force = response(15.0, 2.0 * np.pi * 10.0)
    assert share(velocity[:500], -force[:500]) > 0.95
    assert share(velocity[:0], force[:0]) == 0.0


def test_an_oscillation_at_the_end_of_a_trial_in_blocks_is_found():
    t = np.arange(0.0, 30.0, STEP)
    velocity = 1e-3 * np.sin(2.0 * np.pi * 10.0 * t) * (t > 20.0)
    spectra = RunningSpectra()
    for part in np.split(velocity, 30):
        spectra.add(part, -15.0 * part, np.full(len(part), STEP))
    assert spectra.result().share == pytest.approx(share(velocity, -15.0 * velocity))
    assert spectra.result().share > 0.95


def test_the_tremor_of_a_stiff_arm_is_not_counted_as_unstable(feedback_settings):
    result = run_trial(feedback_settings("model-mediated", "soft", 1500.0, seed=2, duration=6.0))
    assert result.feedback()["stable"]


@pytest.mark.parametrize("tremor", [0.0, operators.TREMOR_AMPLITUDE])
def test_an_oscillation_without_a_stop_is_counted_as_unstable_with_and_without_tremor(
    monkeypatch, feedback_settings, tremor
):
    monkeypatch.setattr(operators, "TREMOR_AMPLITUDE", tremor)
    monkeypatch.setattr(sides, "MOST_SHARE", np.inf)
    settings = feedback_settings("position-force", "hard", 150.0, duration=6.0)
    result = run_trial(settings)
    assert result.fault is None
    assert not result.feedback()["stable"]
    active = result.recording.where(result.recording["mode"] == ACTIVE)
    felt = hand(active, 0.5, 15.0, 0.0)
    arm = partial(arm_damping, settings)
    found = loop_oscillation(felt.velocity, active["drive_force"], active["dt"], arm)
    assert found.share > 0.8
    assert found.amplitude > found.tremor
