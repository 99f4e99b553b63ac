"""A force that drifts, and a stiffness that changes during a record, are reported as such."""

from __future__ import annotations

import re

import numpy as np
import pytest

from estimation.testing_records import relaxed
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.constancy import Cycles, isolated_cycles, monotone_change
from teleop.evaluation.reading.signals import Signals, periods


def result(t, x, f, noise=5e-3):
    f = f + np.random.default_rng(0).normal(0.0, noise, len(t))
    return analyse(Signals(t, x, f, periods(t), "position")).result


def ramp_and_hold():
    t = np.arange(0.0, 60.0, 0.01)
    return t, np.interp(t, [0.0, 10.0, 30.0, 40.0, 60.0], [-1e-3, 0.0, 3e-3, 3e-3, -1e-3])


@pytest.mark.parametrize("rate", [0.01, 0.05])
def test_a_force_that_rises_in_a_hold_drifts_and_gives_no_stiffness(rate):
    t, x = ramp_and_hold()
    f = 300.0 * np.maximum(x, 0.0) + rate * t
    held = t < 39.0  # the force out of contact after the hold would show the drift
    found = result(t[held], x[held], f[held])
    assert found.k is None
    assert "the force drifts: at a constant position, it rises" in found.reasons[0]
    found = result(t, x, f)
    assert "the force drifts" in found.reasons[0]
    if rate == 0.01:  # the other drift is three times the force of the specimen
        assert found.k == pytest.approx(300.0, rel=2e-3)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_force_that_is_constant_or_relaxes_in_a_hold_does_not_drift(share):
    t, x = ramp_and_hold()
    depth = np.maximum(x, 0.0)
    f = 300.0 * (depth + share * relaxed(depth, 100.0, 5.0))
    assert not any("drifts" in reason for reason in result(t, x, f).reasons)


def test_two_stiffnesses_are_a_change_over_the_cycles_and_no_relaxation():
    t = np.arange(0.0, 20.0, 2e-3)
    x = np.maximum(-1e-3, 3e-3 * np.sin(2.6 * np.pi * t + 0.8 * np.sin(1.1 * t)) + 1e-3)
    f = np.where(t < 10.0, 400.0, 800.0) * np.maximum(x, 0.0)
    reasons = " ".join(result(t, x, f, 0.01).reasons)
    first, last = re.findall(r"changes over the cycles, from (\S+) to (\S+) N/m", reasons)[0]
    assert float(first) == pytest.approx(400.0, rel=0.02)
    assert float(last) == pytest.approx(800.0, rel=0.02)
    assert "relaxes" not in reasons


@pytest.mark.parametrize(("frequency", "rest"), [(4.0, 0.5), (4.0, 1.0), (8.0, 0.5)])
def test_a_tremor_before_the_palpation_is_no_change_of_the_stiffness(frequency, rest):
    t = np.arange(0.0, 8.0, 1e-3)
    palpated = 4e-3 + 3e-3 * np.sin(2.0 * np.pi * np.maximum(t - rest, 0.0))
    tremor = np.where(t < rest, 4e-4 * np.sin(2.0 * np.pi * frequency * t), 0.0)
    found = result(t, palpated + tremor, 2000.0 * palpated + 5.0 * np.gradient(palpated, t))
    assert not any("changes" in reason for reason in found.reasons)
    assert found.k == pytest.approx(2000.0, rel=0.03)


def sweep():
    t = np.arange(0.0, 30.0, 2e-3)
    return t, 5e-3 + 1e-3 * np.sin(2.0 * np.pi * (0.1 * t + 0.165 * t**2))


def test_a_stiffness_that_changes_with_the_frequency_is_not_given():
    t, x = sweep()
    found = result(t, x, 500.0 * x + 400.0 * relaxed(x, 500.0, 0.1))
    assert found.k is None
    assert "changes with the frequency" in found.reasons[0]


def test_a_sweep_over_a_body_without_relaxation_has_its_stiffness():
    t, x = sweep()
    found = result(t, x, 500.0 * x + np.gradient(x, t))
    assert found.k_low <= 500.0 <= found.k_high


def palpated(stiffness, seconds=10.0):
    t = np.arange(0.0, seconds, 2e-3)
    x = 2e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    f = 500.0 * stiffness(t / seconds) * x + 6e-3 * np.cos(2.0 * np.pi * t)
    return result(t, x, f)


def test_a_change_for_a_part_of_the_record_is_named_with_its_time():
    found = palpated(lambda s: np.where((s > 0.3) & (s < 0.6), 1.25, 1.0))
    (reason,) = [reason for reason in found.reasons if "changes over the cycles" in reason]
    numbers = r"from (\S+) to (\S+) N/m between (\S+) and (\S+) s"
    first, last, begin, end = (float(one) for one in re.findall(numbers, reason)[0])
    assert first == pytest.approx(500.0, rel=0.02)
    assert last == pytest.approx(625.0, rel=0.02)
    assert begin == pytest.approx(3.0, abs=1.1)
    assert end == pytest.approx(6.0, abs=1.1)
    assert found.k_low <= 500.0
    assert found.k_high >= 625.0


def test_a_single_cycle_with_another_slope_is_no_change():
    found = palpated(lambda s: np.where((s > 0.4) & (s < 0.5), 1.3, 1.0))
    assert not any("changes over the cycles" in reason for reason in found.reasons)


def test_a_single_cycle_of_a_short_record_that_differs_by_far_is_a_change():
    found = palpated(lambda s: np.where((s > 2.76 / 6.3) & (s < 3.7 / 6.3), 0.63, 1.0), 6.3)
    assert any("changes over the cycles" in reason for reason in found.reasons)


def test_slow_softening_is_a_change():
    found = palpated(lambda s: 1.0 - 0.3 * s)
    assert any("changes over the cycles" in reason for reason in found.reasons)


def test_the_slopes_of_the_cycles_are_summarised():
    t = np.arange(0.0, 10.0, 2e-3)
    x = 2e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    summary = analyse(Signals(t, x, 500.0 * x, periods(t), "position")).summary()["cycles_summary"]
    assert summary["count"] >= 6
    assert summary["k_low_quartile"] <= summary["k_median"] <= summary["k_high_quartile"]
    assert summary["k_median"] == pytest.approx(500.0, rel=1e-3)


def shifted(rate, stiffness=1.0, clock=1e-3):
    t = np.arange(0.0, 12.0, 1.0 / rate)
    x = 2e-3 + 1e-3 * np.sin(2.0 * np.pi * t)
    f = 1600.0 * stiffness * x + 4.0 * np.gradient(x, t)
    return result(t, x, np.interp(t * (1.0 - clock), t, f), 3e-3)


@pytest.mark.parametrize("clock", [1e-3, -1e-3])
def test_clocks_that_differ_give_no_damping(clock):
    found = shifted(1000.0, clock=clock)
    assert found.k == pytest.approx(1600.0, rel=5e-3)
    assert not found.determines("b")
    assert any("clocks of position and force differ by 0.10%" in text for text in found.reasons)


def test_equal_clocks_and_softening_are_no_drift_of_the_lag():
    softer = 1.0 - 0.25 * np.arange(0.0, 12.0, 1e-3) / 12.0
    for found in (shifted(1000.0, clock=0.0), shifted(1000.0, softer, clock=0.0)):
        assert found.determines("b")
        assert not any("clocks" in text for text in found.reasons)


def seven_cycles(stiffness):
    t = np.arange(0.0, 10.0, 5e-3)
    x = 5e-3 + 2e-3 * np.sin(2.0 * np.pi * 0.75 * t)
    return result(t, x, stiffness(t) * x)


@pytest.mark.parametrize("change", [1.5, 0.7])
def test_two_of_seven_cycles_with_another_stiffness_are_a_change(change):
    found = seven_cycles(lambda t: np.where((t > 3.4) & (t < 6.6), change * 500.0, 500.0))
    (text,) = (reason for reason in found.reasons if "changes over the cycles" in reason)
    first, last = re.findall(r"from (\S+) to (\S+) N/m between", text)[0]
    assert float(first) == pytest.approx(500.0, rel=0.02)
    assert float(last) == pytest.approx(change * 500.0, rel=0.1)


def test_seven_cycles_with_the_same_stiffness_are_no_change():
    found = seven_cycles(lambda t: np.full(len(t), 500.0))
    assert not any("changes" in reason for reason in found.reasons)


def five_cycles(factor):
    t = np.arange(0.0, 20.5, 5e-3)
    x = 3e-3 - 1e-3 * np.cos(2.0 * np.pi * 0.25 * t)
    return result(t, x, 800.0 * factor(t) * x, 5e-3)


def test_a_stiffness_in_proportion_to_the_time_is_a_change_in_five_cycles():
    reasons = five_cycles(lambda t: 1.0 - 0.015 * t).reasons
    assert any("changes over the cycles" in reason for reason in reasons)
    assert not any("changes over" in reason for reason in five_cycles(np.ones_like).reasons)


def test_a_change_of_the_middle_cycles_is_found_in_five_cycles():
    reasons = five_cycles(lambda t: np.where((t > 8.0) & (t < 15.5), 1.6, 1.0)).reasons
    assert any("changes over the cycles" in reason for reason in reasons)


def presses(depths, force):
    t = np.arange(0.0, 2.0 * len(depths), 5e-3)
    x = np.zeros(len(t))
    for i, depth in enumerate(depths):
        x += depth * np.where(np.floor(t / 2.0) == i, 0.5 - 0.5 * np.cos(np.pi * t), 0.0)
    x -= 4e-4
    return result(t, x, force(np.maximum(x, 0.0), t), 2e-3)


def test_a_softening_in_presses_of_different_depth_is_a_change():
    depths = 1e-3 * np.array([2.0, 2.6, 2.2, 2.5, 2.1, 2.4, 2.3])
    found = presses(depths, lambda d, t: 500.0 * (0.6 + 0.4 * np.exp(-t / 5.0)) * d)
    assert any("changes over the cycles" in reason for reason in found.reasons)


def test_a_softening_by_a_sixth_in_few_presses_is_a_change():
    depths = 1e-3 * np.array([2.2, 2.4, 2.6, 2.5, 2.6, 2.5])
    found = presses(depths, lambda d, t: 500.0 * (0.8 + 0.2 * np.exp(-t / 4.0)) * d)
    assert any("changes over the cycles" in reason for reason in found.reasons)


def test_few_cycles_that_are_deeper_and_deeper_are_no_change():
    k, ones = np.array([500.0, 560.0, 620.0, 680.0]), np.ones(4)
    top = 1e-3 * np.array([1.8, 2.1, 2.4, 2.7])
    cycles = Cycles(2.0 * np.arange(4), 2.0 * ones, k, ones, ones, 1e-3 * ones, top)
    assert monotone_change(cycles) is None
    assert monotone_change(cycles._replace(k=k[::-1], top=top[::-1])) is None
    assert monotone_change(cycles._replace(top=top[::-1])) == (500.0, 680.0)
    assert monotone_change(cycles._replace(top=np.roll(top, 1))) == (500.0, 680.0)


def test_a_stiffness_that_depends_on_the_depth_of_the_presses_is_no_change():
    depths = 1e-3 * np.array([2.2, 2.6, 2.4, 2.3, 2.5, 2.2, 2.6, 2.3, 2.5, 2.4])
    found = presses(depths, lambda d, t: 200.0 * (np.exp(900.0 * d) - 1.0) / 900.0)
    assert not any("changes over the cycles" in reason for reason in found.reasons)


def test_in_a_short_record_a_cycle_in_which_the_stiffness_changes_is_no_second_change():
    k = np.array([995.0, 1020.0, 644.0, 912.0, 995.0])
    error = np.array([0.1, 18.0, 0.1, 70.0, 0.1])
    ones = np.ones(5)
    cycles = Cycles(5.0 * np.arange(5), 5.0 * ones, k, 18.0 * ones, error, 1e-3 * ones, ones)
    assert isolated_cycles(cycles) == (2, 3)
    assert isolated_cycles(cycles._replace(k=995.0 * ones)) is None


def test_presses_of_different_depth_on_two_layers_are_no_change_of_the_stiffness():
    t = np.arange(0.0, 16.0, 4e-3)
    top = np.array([1.2, 1.9, 1.4, 2.2, 1.7, 1.3, 2.4, 1.5])[(t // 2.0).astype(int)] * 1e-3
    x = 0.5 * (top + 1e-3) * (1.0 - np.cos(np.pi * t)) - 1e-3
    depth = np.maximum(x, 0.0)
    found = result(t, x, 500.0 * depth + 2500.0 * np.maximum(depth - 1e-3, 0.0), 0.01)
    assert not any("changes over the cycles" in reason for reason in found.reasons)
    assert any("the stiffness changes at a depth of" in reason for reason in found.reasons)
