"""Lost motion is found in records of unknown bodies, and is not invented in clean records."""

from __future__ import annotations

import math

import numpy as np
import pytest

from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.lost_motion import independent_values, played
from teleop.evaluation.reading.signals import Signals, periods

RATE, AMPLITUDE, K = 500.0, 2e-3, 1500.0
T = np.arange(round(10.0 * RATE)) / RATE


def sine(frequency=0.9):
    return AMPLITUDE * np.sin(2.0 * math.pi * frequency * T)


def several_frequencies():
    parts = ((0.6, 0.5, 0.0), (0.3, 1.1, 1.0), (0.15, 1.9, 2.0))
    return sum(AMPLITUDE * a * np.sin(2.0 * math.pi * hz * T + p) for a, hz, p in parts)


def behind_play(x, half_width):
    """Position of a block that is pushed by two walls at a distance of twice the half width."""
    y, found = x[0], []
    for value in x.tolist():
        y += max(0.0, value - y - half_width) - max(0.0, y - value - half_width)
        found.append(y)
    return np.array(found)


def behind_dahl(x, most):
    """Position behind a spring whose end is held by friction that builds up gradually (Dahl)."""
    z, found = 0.0, []
    for value, change in zip(x.tolist(), np.diff(x, prepend=x[0]).tolist(), strict=True):
        z += change - abs(change) * z / most
        found.append(value - z)
    return np.array(found)


def springpot(x, order=0.15, stiffness=K):
    """Force of a body with structural damping, by the Gruenwald-Letnikov sum."""
    weights = np.cumprod(np.concatenate([[1.0], 1.0 - (order + 1.0) / np.arange(1, len(x))]))
    return stiffness * RATE**order * np.convolve(np.tile(x, 2), weights)[len(x) : 2 * len(x)]


def relaxing(x):
    """Force of a standard linear solid; the motion is periodic, and repeated until steady."""
    z, found = 0.0, []
    for change in np.diff(np.tile(x, 2), prepend=x[0]).tolist():
        z = (z + change) * math.exp(-1.0 / (0.3 * RATE))
        found.append(z)
    return K * x + 0.4 * K * np.array(found[len(x) :])


def linear(x):
    return K * x + 20.0 * np.gradient(x, 1.0 / RATE)


def stiffening(x):
    return linear(x) + 2e8 * (x + AMPLITUDE) ** 3


def record(x, force, seed):
    rng = np.random.default_rng(seed)
    f = 10.0 + force + rng.normal(0.0, 2e-3 * np.ptp(force), len(x))
    counts = np.round((5e-3 + x + rng.normal(0.0, 2e-7, len(x))) / 1e-6) * 1e-6
    return Signals(T, counts, f, periods(T), "position")


@pytest.mark.parametrize(
    ("body", "motion"),
    [(linear, several_frequencies), (stiffening, sine), (relaxing, several_frequencies)],
)
def test_play_is_found_and_removed(body, motion):
    x = motion()
    tip = behind_play(np.tile(x, 2), 80e-6)[len(x) :]
    found = analyse(record(x, body(tip), 1)).result
    exact = analyse(record(tip, body(tip), 1)).result
    assert found.lost_motion.value == pytest.approx(80e-6, rel=0.1)
    assert found.k_low <= exact.k_high  # both are estimates
    assert exact.k_low <= found.k_high
    assert found.b_low <= exact.b <= found.b_high
    assert found.k == pytest.approx(exact.k, rel=0.02)
    assert any(reason.startswith("lost motion of about") for reason in found.reasons)


@pytest.mark.parametrize("motion", [sine, several_frequencies])
def test_gradual_friction_is_found_and_its_effect_is_in_the_intervals(motion):
    x = motion()
    tip = behind_dahl(x, 80e-6)
    found = analyse(record(x, linear(tip), 2)).result
    assert found.lost_motion is not None
    assert found.k_low <= K <= found.k_high
    assert found.b_low <= 20.0 <= found.b_high


def noisy_friction(half_width, seed):
    """Friction in the transmission beside noise of 3 % of the force; b is 20 N s/m."""
    x = sine(2.7)
    x, force = x[::4], linear(behind_dahl(np.tile(x, 2), half_width)[len(x) :])[::4]
    noisy = force + np.random.default_rng(seed).normal(0.0, 3e-2 * np.ptp(force), len(x))
    return Signals(T[::4], x, noisy, periods(T[::4]), "position")


@pytest.mark.parametrize("half_width", [80e-6, 160e-6])
def test_lost_motion_is_found_where_models_without_it_leave_about_the_noise(half_width):
    found = analyse(noisy_friction(half_width, 6)).result
    assert found.lost_motion is not None
    assert found.b_low <= 20.0 <= found.b_high


def test_lost_motion_that_noise_keeps_from_being_confirmed_is_possible_and_in_the_intervals():
    found = analyse(noisy_friction(160e-6, 8)).result
    assert found.lost_motion is None
    assert found.reasons[0].startswith("there is no lost motion, or one of about")
    assert found.k_low <= K <= found.k_high
    assert found.b_low < 0.5 * found.b
    assert found.b_high == pytest.approx(20.0, rel=0.1)


@pytest.mark.parametrize("body", [linear, stiffening, relaxing, springpot])
@pytest.mark.parametrize("motion", [sine, several_frequencies])
def test_no_lost_motion_is_invented_on_a_rigid_rig(body, motion):
    x = motion()
    found = analyse(record(x, body(x), 1)).result
    assert found.lost_motion is None
    assert not any("lost motion of" in reason for reason in found.reasons)


def test_lost_motion_below_the_resolution_is_not_reported():
    x = sine()
    coarse = record(x, linear(behind_play(x, 5e-6)), 3)
    coarse = coarse._replace(x=np.round(coarse.x / 1e-5) * 1e-5)
    assert analyse(coarse).result.lost_motion is None


def test_damping_is_not_determined_where_the_amplitude_is_small():
    x = sine()
    found = analyse(record(x, linear(behind_play(x, 0.3 * AMPLITUDE)), 4)).result
    assert found.identifiable
    assert found.b is None
    assert "too small for b" in found.reasons[0]
    nothing = analyse(record(x, linear(behind_play(x, 0.55 * AMPLITUDE)), 4)).result
    assert nothing.k is None
    assert "too small for k and b" in nothing.reasons[0]


def test_played_is_the_position_between_two_walls():
    x = np.cumsum(np.random.default_rng(5).normal(size=300))
    for out, half_width in zip(played(x, np.array([0.0, 1.5])), (0.0, 1.5), strict=True):
        assert out == pytest.approx(behind_play(x, half_width), abs=1e-12)


def test_values_that_every_cycle_repeats_count_once():
    rng = np.random.default_rng(6)
    assert independent_values(rng.normal(size=1000)) > 400
    cycle = rng.normal(size=50)
    assert independent_values(np.tile(cycle, 20)) < 100
