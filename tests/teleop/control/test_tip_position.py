"""The position of the encoder at which the tip of the slave has a desired position."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_backend import CUBES, Transmission
from teleop.control.tip_position import SMOOTHING, TipPosition


@given(
    lost=st.floats(20e-6, 300e-6),
    compliance=st.floats(1e-7, 1e-5),
    amplitude=st.floats(0.2e-3, 3e-3),
    cube=st.sampled_from(["soft", "medium", "hard"]),
)
def test_the_tip_of_the_simulated_transmission_follows(lost, compliance, amplitude, cube):
    """The oracle is the play operator and the elastic law of the simulation."""
    law, transmission = CUBES[cube], Transmission(lost, compliance)
    inverse, played = TipPosition(lost), 0.0
    for n in range(2000):
        tip = amplitude * (1.0 - math.cos(2.0 * math.pi * n / 1000.0))
        goal = inverse.goal(tip, compliance * law.force(tip, 0.0), 0.0)
        played = transmission.play(played, goal.position)
        reached = law.compressed(played, compliance)
        assert abs(reached - tip) <= 2.0 * SMOOTHING
        if min(tip, 2.0 * amplitude - tip) > 3.0 * SMOOTHING:  # away from the reversals
            assert abs(reached - tip) < 1e-9


@given(st.lists(st.floats(-1e-3, 1e-3), min_size=2, max_size=40), st.floats(0.0, 3e-4))
def test_the_slope_is_the_derivative_of_the_goal(points, lost):
    inverse = TipPosition(lost)
    fine = np.interp(np.arange(0.0, len(points) - 1, 0.01), range(len(points)), points)
    before = inverse.goal(float(fine[0]), 0.0, 0.0).position
    last = float(fine[0])
    for tip in fine[1:].tolist():
        goal = inverse.goal(tip, 0.0, 0.0)
        moved = abs(goal.position - before)
        assert moved <= (1.0 + lost / SMOOTHING) * abs(tip - last) + 1e-12
        assert abs(goal.position - tip) <= lost + 1e-12
        before, last = goal.position, tip


def test_the_slope_contains_the_stretch_of_the_transmission():
    inverse = TipPosition(0.0)
    inverse.goal(0.0, 0.0, 0.0)
    goal = inverse.goal(1e-3, 70e-6, 0.4)
    assert goal.position == pytest.approx(1.07e-3)
    assert goal.slope == pytest.approx(1.4)
