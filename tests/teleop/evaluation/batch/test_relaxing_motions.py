"""The tangent stiffness of a relaxing body, under motions other than ramp and hold or a sine."""

import numpy as np
import pytest

from estimation.testing_records import relaxed, smooth_ramps
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.evaluation.reading.signals import Signals, periods

RATE, DEPTH, K, RELAXING = 100.0, 2e-3, 1000.0, 600.0


def triangle(t: np.ndarray, period: float) -> np.ndarray:
    return DEPTH * (1.0 - np.abs(2.0 * ((t / period) % 1.0) - 1.0))


def result_and_truth(
    x: np.ndarray, time: float, cubic: float = 0.0, seed: int = 0
) -> tuple[StiffnessResult, float]:
    """Return the result of a standard linear solid, and its tangent at half of the force range."""
    t = np.arange(len(x)) / RATE
    f = K * x + cubic * K * x**3 / DEPTH**2 + RELAXING * relaxed(x, RATE, time)
    slope = np.gradient(f, t) / np.where((speed := np.gradient(x, t)) == 0.0, 1.0, speed)
    middle = 0.5 * (f.max() + f.min())
    before = np.flatnonzero((f[:-1] < middle) & (f[1:] >= middle) & (speed[1:] > 0.0))
    share = (middle - f[before]) / (f[before + 1] - f[before])
    truth = float(np.median(slope[before] + share * (slope[before + 1] - slope[before])))
    rng = np.random.default_rng(seed)
    f = f + rng.normal(0.0, 1e-3 * np.ptp(f), len(f))
    x = x + rng.normal(0.0, 5e-4 * DEPTH, len(x))
    return analyse(Signals(t, x, f, periods(t), "position")).result, truth


def loading_slope(t: np.ndarray, x: np.ndarray, f: np.ndarray, force: float) -> float:
    v = np.gradient(x, t)
    near = (v > 0.5 * v.max()) & (np.abs(f - force) < 0.03 * np.ptp(f))
    begins = np.flatnonzero(np.diff(np.flatnonzero(near), prepend=-9) > 1)
    passes = np.split(np.flatnonzero(near), begins[1:])
    return float(np.median([np.polyfit(x[one], f[one], 1)[0] for one in passes if len(one) > 2]))


def check(found: StiffnessResult, truth: float) -> None:
    assert found.k_low is not None
    assert found.k_high is not None
    assert found.k_low <= truth <= found.k_high
    assert found.k_high - found.k_low < 0.15 * truth


@pytest.mark.parametrize(("time", "seconds"), [(1.0, 50.0), (3.0, 20.0)])
def test_one_slow_triangle(time: float, seconds: float) -> None:
    check(*result_and_truth(triangle(np.arange(seconds * RATE) / RATE, seconds), time))


@pytest.mark.parametrize("cubic", [0.0, 0.5])
def test_many_triangles_with_relaxation_faster_than_the_baseline(cubic: float) -> None:
    check(*result_and_truth(triangle(np.arange(40.0 * RATE) / RATE, 5.0), 0.5, cubic))


@pytest.mark.parametrize("time", [1.0, 3.0])
def test_a_slow_unloading_after_a_hold(time: float) -> None:
    times = np.cumsum([0.0, 0.5, 0.5, 15.0, 25.0, 1.0])
    levels = DEPTH * np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    x = smooth_ramps(np.arange(times[-1] * RATE) / RATE, times, levels, 0.05)
    check(*result_and_truth(x, time))


def test_a_record_that_begins_within_the_motion_has_no_stiffening():
    t = np.arange(-60.0, 40.0, 1.0 / RATE)
    x = 2.0 * DEPTH + triangle(t, 4.0)
    f = K * x + RELAXING * (relaxed(x, RATE, 0.3) + relaxed(x, RATE, 15.0))
    kept = t >= 0.0
    rng = np.random.default_rng(5)
    f = f + rng.normal(0.0, 1e-3 * DEPTH * K, len(f))
    found = analyse(Signals(t[kept], x[kept], f[kept], periods(t[kept]), "position"))
    assert not any("depends on depth" in reason for reason in found.result.reasons)
    slope = loading_slope(t[kept], x[kept], f[kept], found.result.force)
    assert found.result.k_low <= slope <= found.result.k_high


def test_the_stated_force_is_measured_where_k_is_the_slope_of_the_record():
    times = 4.0 * np.arange(1, 25) / 4.0
    levels = DEPTH * np.tile([0.0, 1.0, 1.0, 0.0], 6)
    t = np.arange(0.0, 24.0, 1.0 / RATE)
    x = np.interp(t, times, levels)
    f = K * x + 3.0 * K * relaxed(x, RATE, 0.08)  # mostly decayed within a ramp
    rng = np.random.default_rng(6)
    found = analyse(Signals(t, x, f + rng.normal(0.0, 2e-3, len(t)), periods(t), "position")).result
    assert found.k == pytest.approx(loading_slope(t, x, f, found.force), rel=0.05)


@pytest.mark.parametrize("time", [0.3, 0.8])
def test_the_elastic_force_of_a_quasi_linear_body_relaxes(time: float) -> None:
    """Its stiffness grows by the factor 2, and it has no viscosity."""
    t = np.arange(0.0, 16.0, 4e-3)
    x = DEPTH * (0.6 - 0.8 * np.cos(2.0 * np.pi * 0.7 * t - 0.3 * np.sin(1.3 * t)))
    law = K * np.expm1(350.0 * np.maximum(x, 0.0)) / 350.0
    f = np.where(x > 0.0, np.maximum(law + 0.6 * relaxed(law, 250.0, time), 0.0), 0.0)
    f = f + np.random.default_rng(0).normal(0.0, 2e-3 * np.ptp(f), len(t))
    found = analyse(Signals(t, x, f, periods(t), "position"))
    assert found.local is not None
    assert found.local.best.rms < 1.5 * found.record.f_noise_smoothed
    assert found.result.k is not None
    assert found.result.b is not None
    assert abs(found.result.b) < 0.01 * found.result.k / (2.0 * np.pi * 0.7)
    (one,) = found.result.times
    assert one.value == pytest.approx(time, rel=0.1)
