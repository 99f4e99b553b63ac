"""A ramp that never reverses: its trend is the motion, so that no spectrum shows the contact."""

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.testing_records import relaxing_body
from teleop.evaluation.batch.analysis import Analysis, analyse
from teleop.evaluation.batch.strokes import typical_speed
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.signals import Signals, periods
from teleop.evaluation.settings import EstimateSettings
from teleop.output.result_tables import result_lines

RATE, SECONDS, DEPTH, K = 100.0, 10.0, 3e-3, 1000.0


def measured(x: np.ndarray, f: np.ndarray, noise: float, seed: int = 0) -> Analysis:
    """Evaluate a record with noise; that of the force is a fraction of its range."""
    rng = np.random.default_rng(seed)
    f = f + rng.normal(0.0, noise * K * DEPTH, len(f))
    x = x + rng.normal(0.0, 5e-4 * DEPTH, len(x))
    t = np.arange(len(x)) / RATE
    return analyse(Signals(t, x, f, periods(t), "position"))


def ramp() -> np.ndarray:
    return DEPTH * np.arange(round(RATE * SECONDS)) / (RATE * SECONDS)


@pytest.mark.parametrize(
    ("noise", "contact"),
    [(1e-4, 0.0), (1e-3, 1e-3), (0.05, 1e-3), (0.1, 0.0), (0.1, 1e-3)],
)
def test_a_noisy_ramp_gives_its_stiffness(noise: float, contact: float) -> None:
    x = ramp()
    result = measured(x, K * np.maximum(x - contact, 0.0), noise).result
    assert result.k_low is not None
    assert result.k_high is not None
    assert result.k_low <= K <= result.k_high
    assert result.k_high - result.k_low < 0.5 * K
    assert any("one ramp" in reason for reason in result.reasons)


def test_the_tangent_of_a_ramp_on_a_stiffening_body_is_that_at_half_of_the_whole_force() -> None:
    x = ramp()
    f = K * x + 0.9 * K * x**3 / DEPTH**2
    middle = float(np.interp(0.5 * f[-1], f, x))
    result = measured(x, f, 1e-3).result
    assert result.k_low is not None
    assert result.k_high is not None
    assert result.k_low <= K + 2.7 * K * middle**2 / DEPTH**2 <= result.k_high


@pytest.mark.parametrize("rise", [0.0, 1.0])
def test_a_ramp_whose_force_hardly_rises_gives_no_stiffness_but_the_noise_as_reason(
    rise: float,
) -> None:
    x = ramp()
    result = measured(x, 0.01 * rise * K * x, 0.01).result
    assert result.k is None
    assert "does not resolve" in result.reasons[0]


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_a_slow_smooth_stroke_gives_its_stiffness_at_a_high_sampling_rate(noise: float) -> None:
    x = 0.5 * DEPTH * (1.0 - np.cos(np.pi * np.arange(4000) / 4000))
    result = measured(x, K * x, noise).result
    assert result.k_low is not None
    assert result.k_high is not None
    assert result.k_low <= K <= result.k_high
    assert result.k_high - result.k_low < 0.1 * K


@pytest.mark.parametrize("seed", [310007, 310054])
def test_short_steps_between_long_holds_on_a_relaxing_body_are_no_puncture(seed: int) -> None:
    rng = np.random.default_rng([zlib.crc32(b"relaxing body"), seed])
    record = relaxing_body(rng)
    signals = Signals(record.t, record.x, record.f, periods(record.t), "position")
    result = analyse(signals).result
    assert result.k == pytest.approx(record.k, rel=0.02)


@given(st.floats(0.1, 10.0), st.integers(0, 300))
def test_rests_do_not_change_the_typical_speed(speed: float, rest: int) -> None:
    moving = np.full(20, speed)
    assert typical_speed(np.concatenate([moving, np.zeros(rest)])) == speed


@pytest.mark.parametrize("seed", range(2))
def test_a_noisy_ramp_from_free_motion_has_its_contact_point(seed: int) -> None:
    analysis = measured(ramp(), K * np.maximum(ramp() - 1e-3, 0.0), 0.007, seed)
    point = analysis.phases.contact_point
    assert point is not None
    assert point.low <= 1e-3 <= point.high


@pytest.mark.parametrize("seed", range(3))
def test_a_stroke_with_one_speed_at_each_depth_determines_no_damping(seed: int) -> None:
    t = np.arange(round(0.4 * RATE)) / RATE
    x = 1.5e-3 * (1.0 - np.cos(2.0 * np.pi * t / 1.2))
    v = np.gradient(x, 1.0 / RATE)
    stiffening = K * x * (1.0 + 40.0 * x) + 8.0 * v
    f = stiffening + np.random.default_rng(seed).normal(0.0, 2e-3, len(t))
    result = analyse(Signals(t, x, f, periods(t), "position")).result
    assert result.b is None or "each depth is passed with one speed" in result.b_reason
    if result.k is not None:
        tangent = K * (1.0 + 80.0 * float(np.interp(result.force, stiffening, x)))
        assert result.k_low <= tangent <= result.k_high


def test_at_a_constant_speed_the_damping_is_not_determined() -> None:
    x = ramp()
    t = np.arange(len(x)) / RATE
    f = K * x + np.random.default_rng(0).normal(0.0, 0.01, len(t))
    evaluation = evaluate(Signals(t, x, f, periods(t), "position"), EstimateSettings())
    summary = evaluation.batch_summary()
    assert any("speed in contact is constant" in one for one in summary["result"]["reasons"])
    assert "damping   b is not determined" in result_lines(summary)
