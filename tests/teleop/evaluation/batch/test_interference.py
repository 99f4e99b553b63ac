"""Interference in the force is named, and gives no stiffness at a harmonic of the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.interference import mains_at_harmonic
from teleop.evaluation.batch.smoothed_record import smoothed_signals
from teleop.evaluation.reading.signals import Signals, periods


def result(hum, amplitude=0.4, rate=100.0, cubic=0.0, friction=0.0):
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 20.0, 1.0 / rate)
    x = 2e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    v = 2.0 * np.pi * 1e-3 * np.cos(2.0 * np.pi * t)
    f = 800.0 * x + 4.0 * v + cubic * x**3 + friction * np.tanh(v / 5e-4)
    f += amplitude * np.sin(2.0 * np.pi * hum * t + 1.0) + rng.normal(0.0, 0.01, len(t))
    return analyse(Signals(t, x + rng.normal(0.0, 3e-7, len(t)), f, periods(t), "position")).result


@pytest.mark.parametrize(("hum", "order"), [(97.0, 3), (96.0, 4), (95.0, 5)])
def test_hum_aliased_onto_a_harmonic_gives_no_stiffness(hum, order):
    found = result(hum)
    assert found.k is None
    assert f"{order} times the frequency of the motion" in found.reasons[0]


@pytest.mark.parametrize(("hum", "seen"), [(98.77, 1.23), (87.3, 12.7), (92.55, 7.45)])
def test_hum_between_the_harmonics_is_a_remark(hum, seen):
    found = result(hum)
    assert found.k_low <= 800.0 <= found.k_high
    (reason,) = [reason for reason in found.reasons if "interference" in reason]
    frequency = float(reason.split(" N at ")[1].split(" Hz")[0])
    assert frequency == pytest.approx(seen, abs=0.05)


@pytest.mark.parametrize(("cubic", "friction"), [(0.0, 0.0), (1e8, 0.0), (0.0, 0.2)])
def test_a_body_that_stiffens_or_has_friction_has_no_interference(cubic, friction):
    reasons = result(97.0, 0.0, cubic=cubic, friction=friction).reasons
    assert not any("interference" in reason for reason in reasons)


def slow_rate(hum, seconds=20.0, amplitude=0.3, cubic=0.0):
    rng = np.random.default_rng(3)
    t = np.arange(0.0, seconds, 1.0 / 48.0)
    x = 2e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    f = 800.0 * x + 24.0 * np.cos(2.0 * np.pi * t) * 1e-3 + cubic * x**3
    f += amplitude * np.sin(2.0 * np.pi * hum * t + 0.4) + rng.normal(0.0, 5e-3, len(t))
    return analyse(Signals(t, x, f, periods(t), "position")).result


@pytest.mark.parametrize("seconds", [5.5, 20.0])
def test_mains_that_aliasing_moves_to_twice_the_motion_give_no_stiffness(seconds):
    found = slow_rate(50.0, seconds)  # appears at 2 Hz
    assert found.k is None
    assert "hum of 50 Hz appears at 2 Hz by aliasing, 2 times the frequency" in found.reasons[0]


def test_mains_that_aliasing_moves_to_the_motion_are_a_remark():
    t = np.arange(0.0, 20.0, 1.0 / 49.0)
    x = 2e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    found = analyse(Signals(t, x, 800.0 * x, periods(t), "position")).result
    assert found.k == pytest.approx(800.0, rel=0.01)
    assert any("hum of 50 Hz appears at 1 Hz" in reason for reason in found.reasons)


def test_a_linear_body_without_hum_is_determined_at_a_rate_near_the_mains():
    found = slow_rate(50.0, amplitude=0.0)
    assert found.k_low <= 800.0 <= found.k_high
    assert not any("interference" in reason for reason in found.reasons)


def test_the_mean_of_several_samples_moves_no_hum_to_a_harmonic():
    t = np.arange(0.0, 20.0, 1.0 / 58.0)
    x = 2e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    f = 800.0 * x + 2e8 * (x - 2e-3) ** 2 * x
    record = smoothed_signals(Signals(t, x, f, periods(t), "position"))
    assert record.sampling_period == record.period
    assert mains_at_harmonic(record).mains == 60.0  # 60 - 58 Hz is twice the frequency
    assert mains_at_harmonic(replace(record, sampling_period=record.period / 10.0)) is None
