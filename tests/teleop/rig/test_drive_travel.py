"""Tolerance of the travel that a drive's sensors measure."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Ages, Measurement
from drivers.rig_file import read_rig_file
from teleop.rig.drive_check import BAND, SLACK, DriveTravel

CHANNELS = read_rig_file(Path(__file__).parents[3] / "rigs" / "serial-board.toml").sections.channels
COUNT = 1e-6
"""Resolution of the encoder in that file [m]."""
FRESH = Ages(0.0, 0.0, 0.0, 0.0, 0.0)
directions = st.sampled_from([-1.0, 1.0])


def measurement(position, velocity=math.nan, force=0.0):
    return Measurement(0.0, 0.0, math.nan, position, force, velocity, FRESH)


def travelled(commanded, moved, velocity=math.nan, force=0.0, compliance=0.0):
    """Return the travel of a slave after a commanded motion of a second, and a measured one [m]."""
    travel = DriveTravel("slave", CHANNELS, compliance)
    travel.advance(0.0, measurement(3e-3), 0.1)
    travel.begin()
    travel.advance(commanded, measurement(3e-3 + moved, velocity, force), 1.0)
    return travel


@given(
    commanded=st.floats(0.2e-3, 1e-3),
    ratio=st.floats(-20.0, 20.0),
    direction=directions,
)
def test_a_settled_drive_is_accepted_only_within_the_tolerance(commanded, ratio, direction):
    difference = abs(ratio - 1.0) * commanded - BAND * commanded - SLACK - COUNT
    if abs(difference) < 1e-9:
        return
    problem = travelled(direction * commanded, direction * ratio * commanded).problem(settled=True)
    assert bool(problem) == (difference > 0.0)
    if problem and abs(ratio) > 1e-6:
        assert ("sign" if ratio < 0.0 else "scale") in problem


@given(commanded=st.floats(0.0, 1e-3), share=st.floats(0.0, 1.0), direction=directions)
def test_the_travel_of_a_moving_drive_may_be_smaller_than_commanded(commanded, share, direction):
    travel = travelled(direction * commanded, direction * share * commanded)
    assert not travel.problem(settled=False)


@given(commanded=st.floats(1e-6, 1e-3), beyond=st.floats(1e-6, 1e-3), direction=directions)
def test_the_travel_of_a_moving_drive_may_be_neither_larger_nor_reversed(
    commanded, beyond, direction
):
    most = SLACK + COUNT + beyond
    ahead = direction * (commanded * (1.0 + BAND) + most)
    assert "scale" in travelled(direction * commanded, ahead).problem(settled=False)
    assert "sign" in travelled(direction * commanded, -direction * most).problem(settled=False)


def test_the_drives_compliance_explains_a_difference_by_the_force():
    assert "scale" in travelled(0.4e-3, 0.2e-3, force=20.0).problem(settled=True)
    assert not travelled(0.4e-3, 0.2e-3, force=20.0, compliance=4e-6).problem(settled=True)


@pytest.mark.parametrize("velocity", [-0.4e-3, 0.8e-3, 0.1e-3])
def test_a_velocity_channel_that_differs_is_named(velocity):
    problem = travelled(0.4e-3, 0.4e-3, velocity).problem(settled=True)
    assert "slave_velocity shows" in problem
    assert not travelled(0.4e-3, 0.4e-3, 0.4e-3).problem(settled=True)


@pytest.mark.parametrize(
    ("moved", "refused"), [(0.0, False), (0.5, False), (2.0, False), (-1.5, True), (2.8, True)]
)
def test_a_coupled_moving_part_may_stay_behind_but_not_move_otherwise(moved, refused):
    travel = DriveTravel("slave", CHANNELS, 0.0, coupled=True)
    travel.advance(0.0, measurement(3e-3), 0.1)
    travel.begin()
    travel.advance(0.4e-3, measurement(3e-3 + moved * 0.4e-3), 1.0)
    problem = travel.problem(settled=True)
    assert bool(problem) == refused
    if refused:
        assert problem.endswith(", and that nobody holds the moving part")
