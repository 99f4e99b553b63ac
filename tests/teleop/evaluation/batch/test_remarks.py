"""Terms and digits of the printed result, and the effect of a lag on b."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from estimation.transmission import TransmissionCalibration
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.local_stiffness import time_intervals
from teleop.evaluation.batch.reasons import change_of_single_speed, reasons_after_fit, time_text
from teleop.evaluation.reading.signals import Signals, periods
from teleop.output.result_tables import parameter_text, with_half
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial


def signals(t, x, f, noise=5e-3):
    f = f + np.random.default_rng(0).normal(0.0, noise, len(t))
    return Signals(t, x, f, periods(t), "position")


def sine(lag=0.0, k=1000.0, b=10.0):
    t = np.arange(0.0, 10.0, 5e-3)
    w = 2.0 * np.pi
    x = 1e-3 * np.sin(w * t)
    response = (k + 1j * w * b) * np.exp(-1j * w * lag)
    return signals(t, x, 1e-3 * np.imag(response * np.exp(1j * w * t)))


def test_the_change_of_b_for_a_lag_is_stated():
    prompt, late, late_position = (analyse(sine(lag)).result for lag in (0.0, 1e-3, -1e-3))
    assert prompt.b - late.b == pytest.approx(prompt.b_change_per_ms, rel=0.1)
    assert late_position.b - prompt.b == pytest.approx(prompt.b_change_per_ms, rel=0.1)


def test_a_lag_that_is_not_known_is_a_remark_if_a_millisecond_of_it_matters():
    remark = (
        "a lag of the force is not known: each millisecond of it makes b smaller by 1 N s/m; "
        "a lag of the position makes b larger by as much"
    )
    assert remark in analyse(sine(b=1.5)).result.reasons
    assert remark not in analyse(sine(b=120.0)).result.reasons
    known = analyse(sine(lag=1e-3, b=1.5), TransmissionCalibration(1e-3)).result.reasons
    assert not any("lag of the force" in reason for reason in known)


def test_damping_that_is_not_resolved_is_called_so():
    reasons = analyse(sine(b=0.0)).result.reasons
    assert any("damping is not resolved" in reason for reason in reasons)


def test_lost_motion_is_not_taken_for_relaxation():
    settings = TrialSettings(
        clock="virtual", cube="medium", condition="mimic", duration=6.0, count_in=3.0
    )
    recording = run_trial(settings).recording.estimated()
    t, x, f = (recording[name] for name in ("time", "slave_position", "contact_force"))
    record = Signals(t, x, f, periods(t), "slave_position")
    assert any("lost motion of about 12" in reason for reason in analyse(record).result.reasons)
    t = np.arange(0.0, 12.0, 5e-3)
    x = 2e-3 * np.interp(t % 4.0, [0.0, 0.5, 2.5, 3.0, 4.0], [0.0, 1.0, 1.0, 0.0, 0.0])
    branch = np.zeros(len(t))
    for i in range(1, len(t)):
        branch[i] = (branch[i - 1] + x[i] - x[i - 1]) * np.exp(-5e-3 / 0.3)
    (held,) = relaxation(signals(t, x, 1000.0 * x + 800.0 * branch))
    assert "motion is lost" not in held


def relaxation(record):
    return [reason for reason in analyse(record).result.reasons if "force relaxes" in reason]


def test_two_nearly_equal_time_constants_are_one():
    (one,) = time_intervals((6.3, 6.6), (0.01, 0.02))
    assert one.value == pytest.approx(6.45, rel=1e-3)
    assert one.low < 6.3 < 6.6 < one.high
    first, second = time_intervals((0.3, 6.0), (0.1, math.inf))
    assert first == pytest.approx((0.3, 0.271, 0.332), abs=1e-3)
    assert time_text(first) == "0.300 s [0.271, 0.332]"
    assert time_text(second) == "about 6 s"


def test_offset_and_drift_of_a_short_contact_are_not_identifiable():
    t = np.arange(0.0, 1.0, 1e-4)
    late = t - 0.5
    x = np.maximum(np.where(late < 0.0, 0.157 * late, -0.157 * (late - 0.02)), -5e-3)
    inside = (late > 0.0) & (late < 0.02)
    x[inside] = 1e-3 * np.sin(np.pi * late[inside] / 0.02)
    f = np.maximum(2000.0 * x + 5.0 * np.gradient(x, t), 0.0) * (x > 0.0)
    models = analyse(signals(t, x, f, 0.01)).models(0.0, 0.0)
    assert models
    for fit in models:
        for name, one in fit.parameters.items():
            assert len(parameter_text(name, one._asdict())) < 60
            assert not one.identifiable or not name.startswith("f") or one.high - one.low < 10.0


def test_a_value_has_a_limited_number_of_decimals():
    assert with_half(1.0, 1e-100) == "1.00000 \u00b1 0.00001"


def test_coulomb_friction_is_a_remark_and_viscous_damping_is_none():
    t = np.arange(0.0, 20.0, 5e-3)
    x = 2e-3 * (1.0 - np.cos(np.pi * t))
    v = np.gradient(x, t)
    for f, friction in ((400.0 * x + 0.3 * np.tanh(v / 2e-4), True), (400.0 * x + 60.0 * v, False)):
        reasons = analyse(signals(t, x, f)).result.reasons
        assert any("friction" in reason for reason in reasons) is friction


@pytest.mark.parametrize("pull", [0.0, 0.02])
def test_a_pull_at_release_is_called_adhesion(pull):
    t = np.arange(0.0, 30.0, 0.01)
    x = np.interp(t, [0, 5, 12, 14, 21, 30], [-2e-3, -1e-4, 2e-3, 2e-3, -1.5e-3, -2e-3])
    held = (t > 14.0) & (x > -8e-4)
    f = 100.0 * np.maximum(x, 0.0) - pull * held * np.clip((t - 14.0) / 2.0, 0.0, 1.0)
    reasons = analyse(signals(t, x, f, 5e-4)).result.reasons
    found = [reason for reason in reasons if reason.startswith("adhesion: the force falls by")]
    assert [float(reason.split()[5]) for reason in found] == [pytest.approx(pull, rel=0.1)] * (
        pull > 0.0
    )


def test_a_wide_interval_of_a_model_that_fits_is_not_called_no_contact():
    analysis = analyse(sine())
    record, phases = analysis.record, analysis.phases
    (reason,) = reasons_after_fit(record, phases, analysis.local, analysis.local.k)
    assert reason.text.startswith("the stiffness is not determined")
    poor = replace(analysis.local, r2=0.5)
    (reason,) = reasons_after_fit(record, phases, poor, poor.k)
    assert "no contact, noise, or too little motion" in reason.text


def test_slow_noise_of_the_force_is_no_adhesion():
    rng = np.random.default_rng(12)
    t = np.arange(0.0, 24.0, 2e-3)
    x = 1e-3 + 4e-3 * np.sin(2.0 * np.pi * 0.3 * t)
    pole = np.exp(-2e-3 / 0.2)
    slow = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], rng.normal(size=len(t)))
    f = 500.0 * np.maximum(x, 0.0) + 0.025 * slow
    assert not any("adhesion" in reason for reason in analyse(signals(t, x, f)).result.reasons)


def test_a_small_adhesion_with_a_short_retraction_does_not_change_the_stiffness():
    t = np.arange(0.0, 40.0, 5e-3)
    x = 3.0e-4 - 4.6e-4 * np.clip(1.3 * np.cos(0.25 * np.pi * t), -1.0, 1.0)
    f, attached = np.zeros(len(t)), False
    for i, depth in enumerate(x.tolist()):
        attached = depth > 0.0 or (attached and depth > -9e-5)
        f[i] = 3000.0 * depth * attached
    found = analyse(signals(t, x, f, 4e-3)).result
    assert found.k == pytest.approx(3000.0, rel=0.01)
    assert any(reason.startswith("adhesion") for reason in found.reasons)


def test_softening_by_the_largest_depth_is_named_beside_relaxation():
    """The force at a depth decreases by up to 40 % if the specimen was deeper before."""
    t = np.arange(0.0, 40.0, 5e-3)
    depth = 2e-3 + 1e-3 * np.floor(t / 8.0)
    x = np.maximum(0.5 * (depth + 5e-4) * (1.0 - np.cos(np.pi * t)) - 5e-4, 0.0)
    deepest = np.maximum(np.maximum.accumulate(x), 1e-9)
    f = (600.0 * x + 6e4 * x**2) * (1.0 - 0.4 * (1.0 - x / deepest))
    position = 0.5 * (depth + 5e-4) * (1.0 - np.cos(np.pi * t)) - 5e-4
    reasons = analyse(signals(t, position, f)).result.reasons
    assert any("relaxes" in one and "reached before" in one for one in reasons)


def test_a_drift_that_few_cycles_do_not_separate_is_the_cause_of_the_bad_fit():
    t = np.arange(0.0, 10.0, 5e-3)
    x = 1e-3 * np.sin(2.0 * np.pi * 0.6 * t)
    force = 1000.0 * x + 10.0 * np.gradient(x, t)
    drifting = analyse(signals(t, x, force + 1.2 * t / 10.0)).result
    (remark,) = (reason for reason in drifting.reasons if "bad fit" in reason)
    change = float(remark.split("because the force drifts by ")[1].split()[0])
    assert change == pytest.approx(1.2, rel=0.05)
    assert drifting.k_low < 1000.0 < drifting.k_high
    scattered = analyse(signals(t, x, force, 0.5)).result
    assert not any("drifts" in reason for reason in scattered.reasons)


def test_a_position_that_is_passed_with_one_speed_does_not_separate_damping_and_stiffness():
    x = np.linspace(0.0, 2e-3, 200)
    loading = 3e-3 - x  # the tip becomes slower
    assert change_of_single_speed(x, loading, 1e-3) == pytest.approx(1.0, rel=1e-6)
    both = np.concatenate([x, x]), np.concatenate([loading, -loading])
    assert change_of_single_speed(*both, 1e-3) is None
    two_speeds = np.concatenate([x, x]), np.concatenate([loading, 2.0 * loading])
    assert change_of_single_speed(*two_speeds, 1e-3) is None
