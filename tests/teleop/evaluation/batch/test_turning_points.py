"""Turning points of a motion with oscillations within the lost motion, and its frequency."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backend import CUBES
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.strokes import (
    cycle_frequency,
    turning_points,
    without_lost_motion,
)
from teleop.evaluation.reading.signals import Signals, periods

RATE = 1000.0
TRAVEL = 0.7e-3
"""Travel of the stroke [m], which causes 38 N on the hard cube."""
LOST = 0.12e-3
"""Lost motion between the position sensor and the tip [m]."""


def tip(x, lost):
    """Return the position of a tip that follows the motor x with the lost motion `lost` [m]."""
    positions = np.empty_like(x)
    at = x[0]
    for i, value in enumerate(x):
        at = min(max(at, value - 0.5 * lost), value + 0.5 * lost)
        positions[i] = at
    return positions


def strokes_with_oscillation(amplitude):
    """Return time [s] and position [m] of six strokes, with an oscillation of 10 Hz in pauses."""
    t = np.arange(round(6.0 * RATE)) / RATE
    phase = t % 1.0
    level = np.interp(phase, [0.0, 0.3, 0.5, 0.8, 1.0], [0.0, 1.0, 1.0, 0.0, 0.0])
    pause = ((phase > 0.3) & (phase < 0.5)) | (phase > 0.8)
    return t, TRAVEL * level + amplitude * pause * np.sin(20.0 * np.pi * t)


@pytest.mark.parametrize("rest", [0.0, 5.0])
@pytest.mark.parametrize("cycles", [3, 4, 5, 6])
def test_a_rest_between_the_cycles_does_not_change_their_frequency(rest, cycles):
    period = 1e-3
    cycle = 1.0 - np.cos(2.0 * np.pi * np.arange(0.0, 1.0, period))
    x = np.concatenate([np.tile(cycle, cycles), np.zeros(round(rest / period)), cycle])
    assert cycle_frequency(x, period) == pytest.approx(1.0, rel=0.02)


def test_an_oscillation_within_the_lost_motion_does_not_divide_a_stroke():
    t, x = strokes_with_oscillation(0.058e-3)
    f = 10.0 + 45e3 * tip(x, LOST)
    noise = np.random.default_rng(0).normal(0.0, 0.02, len(t))
    phases = analyse(Signals(t, x, f + noise, periods(t), "position")).phases.phases
    names = [phase.name for phase in phases]
    assert 5 <= names.count("loading") <= 6
    assert 5 <= names.count("unloading") <= 6


def test_the_same_oscillation_of_the_tip_divides_the_strokes():
    _, x = strokes_with_oscillation(0.05e-3)
    f = 10.0 + 45e3 * x
    turns = turning_points(x, 0.05 * float(np.ptp(x)))
    assert len(turns) > 30
    assert without_lost_motion(turns, x, f) == turns


@given(
    cube=st.sampled_from(sorted(CUBES)),
    steps=st.lists(st.floats(0.0, 1.0), min_size=3, max_size=30),
)
def test_on_a_cube_without_lost_motion_no_turning_point_is_removed(cube, steps):
    body = CUBES[cube]
    deepest = {"soft": 15e-3, "medium": 6e-3, "hard": 0.7e-3}[cube]
    x = np.interp(np.linspace(0.0, len(steps) - 1.0, 40 * len(steps)), range(len(steps)), steps)
    x = deepest * x
    f = np.array([body.force(value, 0.0) for value in x])
    turns = turning_points(x, 0.05 * max(float(np.ptp(x)), 1e-6))
    assert without_lost_motion(turns, x, f) == turns
