"""Force and depth of the tangent are those of the record, with and without a baseline."""

from __future__ import annotations

import numpy as np
import pytest

from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.reading.signals import Signals, periods


def result(t, x, f):
    f = f + np.random.default_rng(0).normal(0.0, 5e-3, len(t))
    return analyse(Signals(t, x, f, periods(t), "position")).result


def breathing(amplitude):
    """Return a palpation of 2 mm on a surface that moves with breathing."""
    t = np.arange(0.0, 30.0, 2e-3)
    phase = 0.5 * np.pi * t
    surface = amplitude * (np.sin(phase) + 0.2 * np.sin(2.0 * phase + 1.0))
    x = 2e-2 + 2e-3 * np.sin(2.2 * np.pi * t)
    return t, x, 500.0 * (x - surface)


@pytest.mark.parametrize("amplitude", [2e-3, 5e-3])
def test_the_force_of_the_tangent_is_in_the_middle_of_a_force_with_breathing(amplitude):
    t, x, f = breathing(amplitude)
    found = result(t, x, f)
    assert found.force == pytest.approx(f.mean(), abs=1.0)
    assert found.k == pytest.approx(500.0, rel=5e-3)


def test_breathing_that_moves_the_surface_much_farther_than_the_tip_is_named():
    found = result(*breathing(1e-2))
    assert found.k is None
    assert "surface moves" in found.reasons[0]


def test_the_tangent_is_above_the_lowest_position_if_the_force_drifts():
    t = np.arange(0.0, 60.0, 0.01)
    x = 2e-3 * (1.0 - np.cos(np.pi * t))
    f = 300.0 * x + 3.0 * (1.0 - np.exp(-t / 20.0))
    found = result(t, x, f)
    assert found.depth == pytest.approx(2e-3, rel=0.05)
    assert found.force == pytest.approx(f.mean(), abs=0.2)
    assert found.depth_from == "lowest position"
