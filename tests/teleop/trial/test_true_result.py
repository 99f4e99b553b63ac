"""True values of the result of a trial on the simulated rig."""

from __future__ import annotations

from dataclasses import replace

import pytest

from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.recorded import recorded_signals
from teleop.evaluation.settings import EstimateSettings
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.recorded_trial import recorded_transmission, true_result
from teleop.trial.run import run_trial


@pytest.fixture(scope="module")
def recording():
    settings = TrialSettings("autonomous", cube="hard", duration=4.0, clock="virtual")
    return run_trial(settings).recording


def test_the_true_stiffness_is_the_slope_of_the_static_force(recording):
    setup = TrialSettings("autonomous", cube="hard").setup
    position, step = 8e-4, 1e-8
    force = [setup.static_force(setup.cube.slow, position + sign * step) for sign in (-1.0, 1.0)]
    tip = [
        setup.cube.slow.compressed(position + sign * step, setup.transmission.compliance)
        for sign in (-1.0, 1.0)
    ]
    true = true_result(recording, position)
    assert true["k"] == pytest.approx((force[1] - force[0]) / (2.0 * step), rel=1e-6)
    assert true["k_tip"] == pytest.approx((force[1] - force[0]) / (tip[1] - tip[0]), rel=1e-6)
    share = (tip[1] - tip[0]) / (2.0 * step)
    assert true["b"] == pytest.approx(setup.cube.slow.b * share, rel=1e-6)
    assert true["b_tip"] == setup.cube.slow.b


def test_the_result_of_a_trial_is_near_its_true_values(recording):
    settings = EstimateSettings(transmission=recorded_transmission(recording))
    result = evaluate(recorded_signals(recording), settings).analysis.result
    true = true_result(recording, result.position)
    assert result.k == pytest.approx(true["k"], rel=0.01)
    assert result.k_tip.value == pytest.approx(true["k_tip"], rel=0.02)
    assert result.b == pytest.approx(true["b"], rel=0.5)


def test_a_recording_without_valid_settings_or_a_result_has_no_true_values(recording):
    assert true_result(recording, None) is None
    assert true_result(replace(recording, settings={}), 8e-4) is None
