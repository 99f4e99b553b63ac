"""A saturated force sensor gives no stiffness; lost motion and a coarse sensor are none."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from estimation.transmission import TransmissionCalibration
from teleop.cli import main
from teleop.errors import InputError
from teleop.evaluation.across.groups import short
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.contact_phases import clipped
from teleop.evaluation.batch.smoothed_record import smoothed_signals
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.signals import Signals, periods, smallest_step
from teleop.evaluation.settings import EstimateSettings

RATE, K, AMPLITUDE = 500.0, 3000.0, 2e-3
T = np.arange(round(10.0 * RATE)) / RATE
X = AMPLITUDE * np.sin(2.0 * np.pi * T)


def lost(x: np.ndarray, play: float) -> np.ndarray:
    """Return the position of a tip that follows with lost motion."""
    tip, found = x[0], []
    for value in x:
        tip = min(max(tip, value - 0.5 * play), value + 0.5 * play)
        found.append(tip)
    return np.array(found)


def result(x: np.ndarray, f: np.ndarray, seed: int, noise: float = 0.01) -> StiffnessResult:
    f = f + np.random.default_rng(seed).normal(0.0, noise, len(f))
    return analyse(Signals(T, x, f, periods(T), "position")).result


def saturated(found: StiffnessResult) -> bool:
    return any("saturated" in reason for reason in found.reasons)


@settings(max_examples=4, deadline=None)
@given(
    seed=st.integers(0, 100),
    play=st.floats(0.0, 0.2 * AMPLITUDE),
    preload=st.floats(8.0, 20.0),
    noise=st.floats(1e-3, 0.05),
)
def test_lost_motion_is_not_taken_for_saturation(seed, play, preload, noise):
    found = result(X, preload + K * lost(X, play), seed, noise)
    assert found.identifiable
    assert not saturated(found)


def test_the_lost_motion_of_the_simulated_rig_is_not_taken_for_saturation(tmp_path, capsys):
    path = str(tmp_path / "trial.mcap")
    run = ["run", "--condition", "autonomous", "--cube", "medium", "--clock", "virtual"]
    run += ["--duration", "5"]
    assert main([*run, "--record", path, "--json"]) == 0
    capsys.readouterr()
    assert main(["estimate", path, "--force-lag", "0.00266", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["result"]
    assert found["identifiable"]
    assert not any("saturated" in reason for reason in found["reasons"])


def test_lost_motion_at_the_lowest_force_is_not_taken_for_free_motion(tmp_path, capsys):
    path = str(tmp_path / "trial.mcap")
    run = ["run", "--condition", "mimic", "--cube", "hard", "--seed", "2", "--clock", "virtual"]
    run += ["--duration", "8"]
    assert main([*run, "--record", path, "--json"]) == 0
    capsys.readouterr()
    assert main(["estimate", path, "--transmission", "none", "--json"]) == 0  # not corrected
    found = json.loads(capsys.readouterr().out)
    assert found["result"]["identifiable"]
    # the trial starts at the surface; later, the lowest force is in contact
    assert "free" not in {phase["phase"] for phase in found["phases"][1:]}


@settings(max_examples=4, deadline=None)
@given(
    seed=st.integers(0, 100),
    share=st.floats(0.5, 0.9),
    play=st.floats(0.0, 0.1 * AMPLITUDE),
    after=st.booleans(),
)
@example(seed=0, share=0.890625, play=0.00018776831143319913, after=True)
def test_a_clipped_sensor_is_found_with_noise_before_or_after_the_clipping(
    seed, share, play, after
):
    f = 10.0 + K * lost(X, play)
    level = 10.0 + K * AMPLITUDE * (0.9 * share if after else share)
    noise = np.random.default_rng(seed).normal(0.0, 0.01, len(f))
    clipped = np.minimum(f, level) + noise if after else np.minimum(f + noise, level)
    found = result(X, clipped, seed, 0.0)
    assert saturated(found)
    assert found.k is None


@pytest.mark.parametrize("count", [0.01, 0.05, 0.2])
def test_a_coarse_force_sensor_is_not_taken_for_saturation(count):
    found = result(X, np.round((10.0 + K * X) / count) * count, 0, 0.0)
    assert not saturated(found)
    assert found.k_low <= K <= found.k_high


def late(lag):
    return K * AMPLITUDE * np.sin(2.0 * np.pi * (T - lag))


def test_a_negative_damping_is_not_determined():
    found = result(X, 10.0 + late(5e-3), 0)
    assert found.k == pytest.approx(K, rel=1e-3)
    assert found.b is found.b_low is found.b_high is None
    (reason,) = [one for one in found.reasons if "damping is not determined" in one]
    assert "it is negative (-" in reason


def test_a_remark_on_negative_damping_does_not_blame_a_lag_that_is_compensated():
    signals = Signals(T, X, 10.0 + late(5e-3), periods(T), "position")
    before, after = (analyse(signals, TransmissionCalibration(lag)).result for lag in (0.0, 1e-3))
    assert any("--force-lag" in hint for hint in before.hints)
    assert any("longer than the compensated lag (1 ms)" in reason for reason in after.reasons)
    assert not any("--force-lag" in hint for hint in after.hints)
    assert any(short(reason).endswith("than the compensated lag") for reason in after.reasons)


def test_the_smallest_step_is_one_count_and_no_rounding_error():
    counts = np.cumsum(np.random.default_rng(0).integers(-3, 4, 100)) * 1e-5
    assert smallest_step(counts) == pytest.approx(1e-5)
    assert smallest_step(np.full(10, 0.3)) == 0.0
    assert smallest_step(np.zeros(1)) == 0.0


def test_a_position_that_never_changes_is_refused_even_with_the_rest():
    signals = Signals(T, np.full(len(T), 1e-3), X, periods(T), "position")
    with pytest.raises(InputError, match="nothing moves"):
        evaluate(signals, EstimateSettings(whole=True))


def test_a_clipped_sensor_is_found_where_a_cycle_has_few_samples_at_the_limit():
    t = np.arange(2000) / 100.0
    x = 1e-3 * np.sin(2.0 * np.pi * 2.9 * t)
    f = 5.0 + 500.0 * x + np.random.default_rng(0).normal(0.0, 2e-3, len(t))
    limited = np.minimum(f, np.percentile(f, 80.0))  # at most 6 samples in a cycle
    assert not clipped(smoothed_signals(Signals(t, x, f, periods(t), "position")))
    assert clipped(smoothed_signals(Signals(t, x, limited, periods(t), "position")))


def test_held_samples_are_not_taken_for_saturation():
    rng = np.random.default_rng(3)
    x = sum(AMPLITUDE * np.sin(2.0 * np.pi * w * T + p) for w, p in ((0.5, 0.1), (1.3, 2.0)))
    f = 10.0 + K * x + rng.normal(0.0, 0.01, len(T))
    held = np.repeat(np.arange(len(T)), rng.integers(6, 14, len(T)))[: len(T)]
    taken = np.cumsum(np.concatenate([[0], np.diff(held) != 0]))
    first = np.searchsorted(taken, np.arange(taken[-1] + 1))
    assert not saturated(analyse(Signals(T, x, f[first][taken], periods(T), "position")).result)
