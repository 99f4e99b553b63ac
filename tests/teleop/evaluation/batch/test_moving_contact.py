"""A contact point that moves from press to press is no relaxation of the force."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.testing_records import relaxed
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.moving_contact import OverPresses
from teleop.evaluation.reading.signals import Signals, periods

K, B = 800.0, 6.0
T = np.arange(0.0, 16.0, 4e-3)
PRESS = np.floor(T / 2.0)
"""Number of the press at each time; they begin out of contact."""
X = 1e-3 - 2e-3 * np.cos(np.pi * T)


def force(x, law=lambda d: K * d):
    d = np.maximum(x, 0.0)
    return np.where(x > 0.0, np.maximum(law(d) + B * np.gradient(x, T), 0.0), 0.0)


def evaluated(f, x=X, noise=0.01, seed=3):
    f = f + np.random.default_rng(seed).normal(0.0, noise, len(T))
    return analyse(Signals(T, x, f, periods(T), "position")).result


def named(result):
    return [r for r in result.reasons if "contact point" in r]


STEPS = 3e-4 * (1.0 - 0.6**PRESS)
CREEP = 3e-4 * -np.expm1(-T / 6.0)
UPWARDS = -4e-5 * PRESS
RANDOM = 1e-4 * np.array([0.2, -0.9, 0.6, 0.1, -0.4, 1.0, -0.7, 0.3])[PRESS.astype(int)]


@pytest.mark.parametrize(
    ("surface", "how"),
    [(STEPS, "recedes"), (UPWARDS, "comes nearer"), (RANDOM, "moves")],
    ids=["recedes", "nearer", "moves"],
)
def test_a_motion_between_the_presses_is_named_and_does_not_change_the_result(surface, how):
    # the position changes out of contact, which the force does not show
    found = evaluated(force(X - surface))
    (remark,) = named(found)
    moved = 1e3 * np.ptp(surface)
    assert f"the contact point {how} by {moved:.2g}"[:-1] in remark
    assert "relaxes" not in " ".join(found.reasons)
    assert found.k == pytest.approx(K, rel=3e-3)
    assert found.b == pytest.approx(B, rel=0.02)


@pytest.mark.parametrize(("share", "power"), [(0.03, 1.0), (0.1, 1.5), (0.05, 2.0)])
def test_a_body_that_stiffens_under_a_creeping_surface_has_its_tangent(share, power):
    surface = CREEP / 3e-4 * share * 3e-3
    size = K * 1.5e-3 ** (1.0 - power)
    found = evaluated(force(X - surface, lambda d: size * d**power))
    assert found.k is not None
    depth = ((found.force or 0.0) / size) ** (1.0 / power)
    assert found.k == pytest.approx(power * size * depth ** (power - 1.0), rel=0.02)
    assert named(found)


def test_a_body_that_relaxes_does_not_move():
    d = np.maximum(X, 0.0)
    v = np.where(X > 0.0, B * np.gradient(X, T), 0.0)
    for tau in (0.3, 2.0):
        f = np.where(X > 0.0, np.maximum(K * (d + 0.5 * relaxed(d, 250.0, tau)) + v, 0.0), 0.0)
        remarks = named(evaluated(f))
        assert all(remark.startswith("the force relaxes, or the contact") for remark in remarks)


def test_a_body_that_softens_does_not_move():
    found = evaluated((1.0 - 0.06 * PRESS) * force(X))
    assert not named(found)
    assert "the stiffness changes over the cycles" in found.reasons[0]


def test_a_surface_that_rests_is_not_mentioned():
    assert not named(evaluated(force(X)))
    assert not named(evaluated(force(X, lambda d: 3e5 * d**2)))


def test_a_surface_between_the_presses_is_that_of_the_nearest_press():
    position = OverPresses(np.array([1.0, 3.0]), np.array([-1.0, 1.0]), in_steps=True)
    assert position.at(np.array([0.0, 1.9, 2.1, 5.0])).tolist() == [-1.0, -1.0, 1.0, 1.0]
    line = position._replace(in_steps=False)
    assert line.at(np.array([0.0, 1.5, 2.0, 5.0])).tolist() == [-1.0, -0.5, 0.0, 1.0]
