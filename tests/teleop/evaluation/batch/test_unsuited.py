"""A recording of a test that determines no tangent stiffness gives the reason that applies."""

from __future__ import annotations

import numpy as np
import pytest

from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.evaluation.reading.signals import Signals, periods


def result(t: np.ndarray, x: np.ndarray, f: np.ndarray, noise: float = 5e-3) -> StiffnessResult:
    f = f + np.random.default_rng(0).normal(0.0, noise, len(f))
    return analyse(Signals(t, x, f, periods(t), "position")).result


def only_reason(found: StiffnessResult) -> str:
    assert found.k is None
    (reason,) = found.reasons
    return reason


@pytest.mark.parametrize("start", [0.0, 6.0])
def test_a_creep_test_is_named_with_and_without_its_loading(start):
    t = np.arange(0.0, 60.0, 0.01)
    f = np.interp(t, [0.0, 5.0, 5.3], [0.0, 0.0, 5.0])
    late = np.maximum(t - 5.3, 0.0)
    x = f / 2500.0 + 3e-3 * (1.0 - np.exp(-late / 8.0))
    part = t >= start
    assert "creep test" in only_reason(result(t[part], x[part], f[part]))


def test_a_puncture_is_named():
    t = np.arange(0.0, 12.0, 0.005)
    x = np.interp(t, [0.0, 2.0, 10.0], [-1e-3, 0.0, 8e-3])
    depth = np.maximum(x, 0.0)
    f = np.where(depth < 5e-3, 300.0 * depth + 2e4 * depth**2, 0.9 + 60.0 * (depth - 5e-3))
    reason = only_reason(result(t, x, f))
    assert "punctured" in reason
    assert "5 mm" in reason or "4.9" in reason


def test_too_few_samples_per_cycle_are_named_and_not_the_noise_of_the_position():
    t = np.arange(0.0, 10.0, 0.02)
    w = 40.0 * np.pi
    x = 5e-4 * np.sin(w * t)
    reason = only_reason(result(t, x, 2000.0 * x + 1e-3 * w * np.cos(w * t)))
    assert "samples per cycle" in reason


def indentation() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(0.0, 20.0, 0.01)
    x = np.interp(t, [0.0, 4.0, 12.0, 20.0], [-1e-3, 0.0, 1e-3, -1e-3])
    return t, x, 3e4 * np.maximum(x, 0.0) ** 1.5


def test_both_signs_inverted_are_named_where_the_force_rests_out_of_contact():
    t, x, f = indentation()
    found = result(t, -x, -f, 5e-4)
    assert "expected force and position positive in compression" in only_reason(found)
    assert any("--invert both" in hint for hint in found.hints)


def test_a_negative_force_in_contact_throughout_is_a_remark():
    t = np.arange(0.0, 10.0, 0.005)
    x = 2e-3 * (1.0 - np.cos(2.0 * np.pi * t))
    found = result(t, -x, -400.0 * x)
    assert any("the force is negative" in reason for reason in found.reasons)
    assert any("--invert both" in hint for hint in found.hints)
    assert not any("--invert" in hint for hint in result(t, x, 400.0 * x).hints)


def test_a_peak_of_the_force_is_not_taken_for_saturation():
    t = np.arange(0.0, 40.0, 0.002)  # palpation at twice the frequency of breathing
    x = 2e-2 + 2e-3 * np.sin(np.pi * t)
    f = 500.0 * (x - 5e-3 * np.abs(np.sin(0.25 * np.pi * t)))
    assert not any("saturated" in reason for reason in result(t, x, f, 0.01).reasons)


def test_a_puncture_where_the_motion_becomes_slow_is_named():
    t = np.arange(0.0, 16.0, 2e-3)
    x = 2e-3 - 2.2e-3 * np.cos(np.pi * t / 2.0) * (0.8 + 0.2 * np.minimum(t, 10.0) / 10.0)
    depth = np.maximum(x, 0.0)
    broken = np.maximum.accumulate(depth) > 4.02e-3
    reason = only_reason(result(t, x, np.where(broken, 0.3, 1.0) * 400.0 * depth))
    assert "punctured" in reason


def test_a_force_at_a_position_that_only_has_noise_is_a_rigid_stop():
    t = np.arange(0.0, 12.0, 2e-3)
    f = 5.0 + 4.0 * np.sin(2.0 * np.pi * t)
    rng = np.random.default_rng(4)
    x = 3e-3 + f / 1e9 + rng.normal(0.0, 4e-7, len(t))
    assert "rigid stop" in only_reason(analyse(Signals(t, x, f, periods(t), "position")).result)


@pytest.mark.parametrize("frequency", [0.3, 3.0])
def test_a_dashpot_is_a_viscous_body(frequency):
    t = np.arange(0.0, 12.0, 0.004)
    x = 2e-3 * np.sin(2.0 * np.pi * frequency * t)
    b = 50.0 / frequency
    reason = only_reason(result(t, x, b * np.gradient(x, t), 0.02))
    assert reason.startswith("the force follows the velocity, not the position: a viscous body")
    value = float(reason.split("body with ")[1].split()[0])
    assert value == pytest.approx(b, rel=0.01)
