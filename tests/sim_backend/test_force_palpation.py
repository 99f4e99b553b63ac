"""The operator who pokes until the felt force, or the depth, reaches an aim."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_backend import ARM, ForcePalpation, FreePalpation, OperatorModel
from sim_backend.force_palpation import PERCEPTION
from sim_backend.operators import REACTION

AIM, DEPTH, DT = 10.0, 15e-3, 1e-3
DAMPING = 40.0


def palpate(k, arm_stiffness, seconds=20.0, changed=None, aim=AIM, seed=0):
    """Simulate a hand that moves a damped spring; return position and force of each time.

    `changed` is the time after which the spring has another stiffness, and this stiffness.
    """
    arm = OperatorModel(arm_stiffness=arm_stiffness).arm
    operator = ForcePalpation(DEPTH, seed, aim, arm_stiffness)
    x, rows = 0.0, []
    for i in range(round(seconds / DT)):
        t = i * DT
        p, v = operator.intention(t)
        stiffness = changed[1] if changed and t > changed[0] else k
        # K (p - x) + D (v - x') = k x + d x', and x' is implicit in x
        rate = (arm.stiffness * (p - x) + arm.damping * v - stiffness * max(x, 0.0)) / (
            arm.damping + DAMPING + DT * (arm.stiffness + stiffness * (x > 0.0))
        )
        x += rate * DT
        force = arm.stiffness * (p - x) + arm.damping * (v - rate)
        operator.feel(t, x, force)
        rows.append((x, force))
    return np.array(rows).T, operator


def peaks(values):
    """Return the largest value of each period of 1.2 s, the mean duration of a poke."""
    length = round(1.2 / DT)
    return values[: len(values) // length * length].reshape(-1, length).max(axis=1)


@pytest.mark.parametrize("arm_stiffness", [150.0, 400.0, 1500.0])
@pytest.mark.parametrize("k", [2000.0, 4400.0, 16000.0])
def test_pokes_approach_the_intended_force(k, arm_stiffness):
    (x, force), operator = palpate(k, arm_stiffness)
    late = peaks(force)[4:]
    assert 0.9 * AIM < late.mean() < 1.2 * AIM
    assert late.max() < 1.5 * AIM
    assert x.max() < DEPTH
    assert operator.expected_stiffness == pytest.approx(k, rel=0.1)


@pytest.mark.parametrize("arm_stiffness", [150.0, 400.0, 1500.0])
def test_without_resistance_the_pokes_reach_the_depth(arm_stiffness):
    (x, force), _ = palpate(0.0, arm_stiffness)
    assert peaks(x)[1:].mean() == pytest.approx(DEPTH, rel=0.15)
    assert force.max() < AIM


def test_the_next_pokes_adapt_to_a_specimen_that_became_stiffer():
    (_, force), operator = palpate(2000.0, 400.0, changed=(8.0, 16000.0))
    late = peaks(force)[10:]
    assert 0.9 * AIM < late.mean() < 1.25 * AIM
    assert operator.expected_stiffness > 14000.0


@pytest.mark.parametrize(("position", "force"), [(1e-3, 3.0 * AIM), (1.1 * DEPTH, 0.0)])
def test_force_and_depth_have_no_effect_before_the_reaction_time(position, force):
    felt, calm = (ForcePalpation(DEPTH, 1, AIM, 400.0) for _ in range(2))
    start = REACTION + 0.2
    for t in np.arange(0.0, start + PERCEPTION - 2 * DT, DT):
        assert felt.intention(t) == calm.intention(t)
        felt.feel(t, *((position, force) if t >= start else (1e-3, 0.0)))
        calm.feel(t, 1e-3, 0.0)
    at_force = calm.intention(start).position
    times = np.arange(start + PERCEPTION, start + PERCEPTION + 0.3, DT)
    moved = np.array([felt.intention(t).position for t in times])
    assert moved[-1] < calm.intention(times[-1]).position - 0.1 * DEPTH
    assert moved[-1] == pytest.approx(at_force, abs=0.1 * DEPTH)


def test_the_correction_is_smooth():
    operator = ForcePalpation(DEPTH, 1, AIM, 400.0)
    times = np.arange(0.0, 3.0, DT)
    rows = []
    for t in times:
        rows.append(operator.intention(t))
        operator.feel(t, 1e-3, 2.0 * AIM * (0.3 < t < 0.6))
    position, velocity = np.array(rows).T
    after = (times > REACTION + 0.01) & (np.abs(times - REACTION - 1.0) > 2e-3)
    slope = np.gradient(position, times)
    np.testing.assert_allclose(velocity[after][:-1], slope[after][:-1], atol=4e-4)


def test_a_negative_withdrawal_leaves_the_body_between_the_pokes():
    operator = FreePalpation(9e-3, 0, withdrawal=-0.2)
    position = np.array([operator.intention(t)[0] for t in np.arange(0.0, 10.0, DT)])
    assert np.count_nonzero((position[1:] > 0.0) & (position[:-1] <= 0.0)) >= 6
    assert -0.4 * 9e-3 < position.min() < -0.1 * 9e-3


def test_the_damping_ratio_of_the_arm_does_not_depend_on_its_stiffness():
    assert OperatorModel().arm == ARM
    ratios = [
        arm.damping / math.sqrt(arm.stiffness)
        for arm in (OperatorModel(arm_stiffness=k).arm for k in (150.0, 400.0, 1500.0))
    ]
    assert ratios == pytest.approx([0.6] * 3)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"arm_stiffness": 20.0}, "arm_stiffness 20 N/m: expected 50 to 2000 N/m"),
        ({"arm_stiffness": math.nan}, "arm_stiffness nan N/m"),
        ({"aim_force": 0.0}, "aim_force 0 N: expected more than 0"),
        ({"withdrawal": -1.0}, "withdrawal -1: expected -0.3 to 0.8"),
    ],
)
def test_an_impossible_operator_is_refused(values, message):
    with pytest.raises(ValueError, match=message):
        OperatorModel(**values)


def test_a_force_that_is_not_positive_is_refused():
    with pytest.raises(ValueError, match="force must be positive"):
        ForcePalpation(DEPTH, 0, 0.0, 400.0)
