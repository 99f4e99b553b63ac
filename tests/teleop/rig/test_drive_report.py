"""The remark of the check on a drive that moves less or more than commanded."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.rig.drive_check import STROKES
from teleop.rig.drive_report import LARGEST_DEVIATION, Stroke, drive_report


def report(moved, explained=1e-6, problem=""):
    strokes = [Stroke(length, moved(length), explained) for length in STROKES]
    return drive_report("slave", 0.05, strokes, problem)


@given(st.floats(-0.5, 2.0))
def test_a_scale_is_remarked_beyond_its_bound_and_named(scale):
    deviation = abs(scale - 1.0) * STROKES[-1] - LARGEST_DEVIATION * STROKES[-1] - 1e-6
    found = report(lambda length: scale * length)
    assert found.ratio == pytest.approx(scale)
    if abs(deviation) > 1e-9:
        assert bool(found.remark) == (deviation > 0.0)
    if found.remark:
        assert "check the scales of drives.slave and of channels.slave_position" in found.remark
        assert "lost motion" not in found.remark


@given(st.floats(25e-6, 90e-6))
def test_travel_that_is_lost_once_is_remarked_as_lost_motion(lost):
    found = report(lambda length: length - lost)
    assert "lost motion or friction of the drive is the likely cause" in found.remark
    assert f"{lost * 1e3:.3f} mm less" in found.remark


@given(st.floats(0.0, 90e-6))
def test_a_loss_that_resolution_and_compliance_explain_is_not_remarked(lost):
    assert not report(lambda length: length - lost, explained=lost).remark


def test_a_drive_without_motion_or_encoder_has_neither_ratio_nor_remark():
    for found in (drive_report("slave", 0.05, [], ""), report(lambda length: math.nan)):
        assert math.isnan(found.ratio)
        assert found.remark == ""


def test_a_problem_replaces_the_remark():
    assert report(lambda length: 0.5 * length, problem="wrong scale").remark == ""


def test_a_coupled_axis_that_stays_behind_has_a_remark_on_its_coupling():
    strokes = [Stroke(0.2e-3, 0.0, 0.0), Stroke(0.4e-3, 0.1e-3, 0.0)]
    found = drive_report("master", 0.05, strokes, "", coupled=True)
    assert "a hand that holds it stretches the coupling" in found.remark


def test_a_watchdog_that_is_not_reported_is_left_to_a_person():
    found = drive_report("master", math.nan, [], "", reports_watchdog=False)
    assert found.remark.startswith("does not report its watchdog: test it by hand")
