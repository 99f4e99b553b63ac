"""Friction in the specimen: Dahl's model, and its distinction from lost motion and stiffening."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
