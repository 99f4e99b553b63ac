"""Faults of logger and sensor are named, and do not change k and b without a word."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.testing_records import COVERAGE_KINDS, relaxed
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.sampling_checks import without_sampling_faults
from teleop.evaluation.reading.signals import Signals, periods

OMEGA = 2.0 * np.pi


def palpation(k=700.0, b=4.0, seconds=10.0, rate=1000.0):
    """Return time, position and force of a sine of 1 Hz on a Kelvin-Voigt body in contact."""
    rng = np.random.default_rng(1)
    t = np.arange(round(seconds * rate)) / rate
    x = 2e-3 + 1e-3 * np.sin(OMEGA * t) + rng.normal(0.0, 3e-7, len(t))
    f = k * (2e-3 + 1e-3 * np.sin(OMEGA * t)) + b * 1e-3 * OMEGA * np.cos(OMEGA * t)
    return t, np.round(x / 1e-6) * 1e-6, f + rng.normal(0.0, 3e-3, len(t))


def signals(t, x, f):
    return Signals(t, x, f, periods(t), "position")


def result(t, x, f):
    return analyse(signals(t, x, f)).result


def held(values, period):
    return values[(np.arange(len(values)) // period * period).astype(int)]


@pytest.mark.parametrize("period", [4, 10, 50.0 / 3.0])
@pytest.mark.parametrize("channel", ["position", "force"])
def test_held_samples_do_not_change_b_and_are_named(channel, period):
    t, x, f = palpation()
    delayed = result(t, held(x, 10), f).b if channel == "position" else None
    x, f = (held(x, period), f) if channel == "position" else (x, held(f, period))
    found = result(t, x, f)
    # an update between two samples is up to one sample late: 1 ms changes b by 0.7 N s/m
    assert found.b == pytest.approx(4.0, abs=0.1 if float(period).is_integer() else 0.8)
    assert delayed is None or delayed == pytest.approx(4.0, abs=0.1)
    assert f"the {channel} is updated every {period:.3g} ms" in found.reasons[0]


def test_a_force_that_is_updated_irregularly_gives_the_damping():
    t, x, f = palpation()
    at = np.cumsum(np.random.default_rng(2).integers(12, 27, len(t)))
    begins = np.concatenate([[0], at[at < len(t)]])
    irregular = f[np.repeat(begins, np.diff([*begins, len(t)]))]
    found = result(t, x, irregular)
    assert found.b == pytest.approx(4.0, abs=0.1)
    assert "the force is updated every 19" in found.reasons[0]


def test_a_force_that_drops_to_zero_and_back_is_left_out():
    t, x, f = palpation()
    for start in (2.1, 5.3, 7.4):
        f[(t > start) & (t < start + 0.05)] = 0.0
    found = result(t, x, f)
    assert found.k == pytest.approx(700.0, rel=2e-3)
    assert found.b == pytest.approx(4.0, abs=0.1)
    assert sum("its data stream stalled" in reason for reason in found.reasons) == 3


def test_the_steps_of_a_coarse_force_sensor_are_no_lost_signal():
    t, x, f = palpation()
    coarse = np.round(f / 0.25) * 0.25
    assert not any("stalled" in reason for reason in result(t, x, coarse).reasons)


def test_both_channels_held_give_b_too():
    t, x, f = palpation()
    found = result(t, held(x, 10), held(f, 4))
    assert found.b == pytest.approx(4.0, abs=0.15)
    assert sum("is updated every" in reason for reason in found.reasons) == 2


@pytest.mark.parametrize("count", [2e-6, 2e-5, 1e-4])
def test_quantised_positions_are_not_held(count):
    t, x, f = palpation()
    quantised = signals(t, np.round(x / count) * count, np.round(f / 0.02) * 0.02)
    assert not without_sampling_faults(quantised).remarks


@pytest.mark.parametrize("channel", ["position", "force"])
@pytest.mark.parametrize(("begin", "end"), [(4.0, 5.0), (7.0, 10.0)])
def test_a_stalled_stream_is_named_and_not_used(channel, begin, end):
    t, x, f = palpation()
    values = x if channel == "position" else f
    stalled = (t >= begin) & (t < end)
    values[stalled] = values[np.argmax(stalled)]
    found = result(t, x, f)
    assert f"the {channel} is constant from {begin:g} to" in found.reasons[0]
    assert "stalled" in found.reasons[0]
    assert found.k == pytest.approx(700.0, rel=2e-3)
    assert found.b == pytest.approx(4.0, abs=0.1)


def test_hold_with_relaxation_free_motion_and_saturation_are_not_stalled():
    t = np.arange(0.0, 20.0, 5e-3)
    x = np.round(np.interp(t, [0, 2, 4, 14, 16, 20], [-1, -1, 3, 3, -1, -1]) * 1e3) * 1e-6
    depth = np.maximum(x, 0.0)
    f = 300.0 * depth + 900.0 * np.maximum(relaxed(depth, 200.0, 1.0), 0.0)
    assert not without_sampling_faults(signals(t, x, f)).remarks
    assert not without_sampling_faults(signals(t, x, np.minimum(f, 0.7))).remarks
    t, x, _ = palpation()
    f = 700.0 * np.clip(x - 2e-3, 0.0, 7e-4)
    assert not without_sampling_faults(signals(t, x, f)).remarks


def test_a_rigid_stop_with_a_coarse_encoder_is_not_a_stalled_position():
    t = np.arange(0.0, 10.0, 1e-3)
    wanted = 5e-3 * np.sin(OMEGA * 0.5 * t) + 1e-3
    x, f = np.round(np.minimum(wanted, 0.0) / 1e-5) * 1e-5, 2000.0 * np.maximum(wanted, 0.0)
    assert not without_sampling_faults(signals(t, x, f)).remarks


@pytest.mark.parametrize("kind", ["intermittent contact", "ramp, hold, release", "relaxing body"])
def test_an_inverted_force_is_named_and_not_taken_for_a_drift_or_puncture(kind):
    record = COVERAGE_KINDS[kind](np.random.default_rng(0))
    found = result(record.t, record.x, -record.f)
    assert found.k is None
    assert "the sign of the force is wrong" in found.reasons[0]
    assert "--invert force" in found.hints[0]


def test_both_signs_inverted_are_named():
    record = COVERAGE_KINDS["intermittent contact"](np.random.default_rng(3))
    found = result(record.t, -record.x, -record.f)
    assert found.k is None
    assert "--invert both" in found.hints[0]


def test_a_lag_that_no_force_channel_has_is_not_blamed_for_negative_damping():
    t, x, f = palpation(k=1600.0)
    found = result(t, x, np.interp(t - 0.2, t, f))
    assert found.k is None
    assert "the force lags behind the position by 19" in found.reasons[0]
    assert "time stamps" in found.reasons[0]
    found = result(t, x, np.interp(t - 0.07, t, f))
    (reason,) = [reason for reason in found.reasons if "it is negative" in reason]
    assert "lag of the force would have to be" in reason
    found = result(t, x, np.interp(t - 0.01, t, f))
    (reason,) = [reason for reason in found.reasons if "it is negative" in reason]
    # of the lag of 10 ms, 2.5 ms only cancel the damping of 4 N s/m
    assert "the force lags behind the position, by 7.5 ms or more, or motion is lost" in reason
