"""Friction in the specimen: Dahl's model, and its distinction from lost motion and stiffening."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d

from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.candidate import FRICTION
from teleop.evaluation.batch.friction import dahl
from teleop.evaluation.reading.signals import Signals, periods


def stepwise(x: np.ndarray, slip: float) -> np.ndarray:
    """Dahl's differential equation dz/dx = (sign(v) - z) / slip * sign(v), sample by sample."""
    z = [0.0]
    for step in np.diff(x).tolist():
        side = math.copysign(1.0, step) if step else z[-1]
        z.append(side + (z[-1] - side) * math.exp(-abs(step) / slip))
    return np.array(z)


@given(
    st.lists(st.floats(-1.0, 1.0).map(lambda value: round(value, 3)), min_size=2, max_size=60),
    st.floats(1e-3, 10.0),
)
def test_friction_is_that_of_the_differential_equation(positions, slip):
    x = np.array(positions)
    np.testing.assert_allclose(dahl(x, np.array([slip]))[0], stepwise(x, slip), atol=1e-12)


@pytest.mark.parametrize("slip", [6e-6, 3e-4])
def test_friction_inside_is_neither_lost_motion_nor_stiffening(slip):
    t = np.arange(0.0, 12.0, 2e-3)
    x = 3e-3 * np.sin(2.0 * np.pi * 0.7 * t)
    v = np.gradient(x, t)
    rng = np.random.default_rng(8)
    f = 500.0 * x + 4.0 * v + 0.15 * stepwise(x, slip) + rng.normal(0.0, 3e-3, len(t))
    found = analyse(Signals(t, x, f, periods(t), "position"))
    assert [one.kind for one in found.local.best.extensions] == [FRICTION]
    assert found.result.lost_motion is None
    assert found.result.k == pytest.approx(500.0, rel=0.005)
    assert found.result.b_low <= 4.0 <= found.result.b_high
    force = found.result.summary()["friction_n"]
    assert force["low"] < 0.15 < force["high"]
    assert not any("depends on depth" in reason for reason in found.result.reasons)


@pytest.mark.parametrize("friction", [0.0, 0.12])
def test_at_one_speed_friction_and_damping_are_one_force(friction):
    """The rounded corners of a triangle wave do not separate them."""
    t = np.arange(0.0, 40.0, 2e-3)
    x = 1.5e-3 + 3e-3 * (1.0 - np.abs(1.0 - 0.5 * (t % 4.0)))
    x = gaussian_filter1d(x, 15.0, mode="nearest")
    f = 700.0 * x + 8.0 * np.gradient(x, t) + friction * stepwise(x, 6e-5)
    f += np.random.default_rng(0).normal(0.0, 5e-3, len(t))
    found = analyse(Signals(t, x, f, periods(t), "position"))
    assert found.result.k == pytest.approx(700.0, rel=0.01)
    assert found.local.loss_force == pytest.approx(friction + 8.0 * 1.5e-3, rel=0.03)
    assert found.result.summary()["friction_n"] is None
    if friction:
        assert found.result.b is None
        assert "one force" in found.result.b_reason
    else:
        assert found.result.b == pytest.approx(8.0, abs=0.5)
        assert any("same effect as damping" in reason for reason in found.result.reasons)
