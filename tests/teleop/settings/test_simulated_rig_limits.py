"""The limits of every palpation of the paper are consistent."""

from __future__ import annotations

import math

import pytest

from sim_backend import CUBES, DEPTH, TRANSMISSION, Setup, Transmission
from teleop.safety import Limits
from teleop.settings.simulated_rig_limits import simulated_rig_limits

CASES = [(moved_by, cube) for moved_by in DEPTH for cube in CUBES]
COMPLIANCE = 2e-6


@pytest.fixture(params=[0.25, 1.0, 4.0])
def scale(request):
    return request.param


@pytest.fixture(params=[0.5, 2.0, 8.0])
def fastest(request):
    return request.param


@pytest.fixture(params=CASES, ids="-".join)
def case(request):
    moved_by, cube = request.param
    return CUBES[cube], DEPTH[moved_by][cube]


@pytest.fixture
def limits(case, scale, fastest) -> Limits:
    return simulated_rig_limits(*case, scale, fastest, COMPLIANCE, TRANSMISSION)


def in_series(cube, x):
    """Force of cube and transmission at a position of the drive."""
    return Setup(cube, 1e-3, x, TRANSMISSION).force(x)


def test_soft_limits_lie_strictly_inside_the_hard_ones(limits):
    (hard_low, hard_high), (low, high) = limits.hard_position, limits.soft_position
    assert hard_low < low < 0.0 < high < hard_high
    assert limits.soft_force < limits.hard_force


def test_the_depth_is_reached_before_any_limit(limits, case):
    cube, depth = case
    assert limits.soft_position[1] >= 1.2 * depth
    assert limits.soft_position[0] <= -0.2 * depth
    assert limits.soft_force >= 1.2 * in_series(cube, depth)


def test_force_limits_are_the_forces_at_the_position_limits(limits, case):
    cube, _ = case
    assert limits.soft_force == pytest.approx(in_series(cube, limits.soft_position[1]))
    assert limits.hard_force == pytest.approx(in_series(cube, limits.hard_position[1]))


def test_hard_limits_lie_inside_the_ranges_of_the_sensors(limits):
    force, position = limits.channels["contact_force"], limits.channels["slave_position"]
    assert force.low < -limits.hard_force < limits.hard_force < force.high
    assert position.low < limits.hard_position[0] < limits.hard_position[1] < position.high
    assert 2.0 * limits.max_velocity < limits.channels["slave_velocity"].high


def test_a_sine_of_the_highest_frequency_over_the_depth_is_not_limited(limits, case, fastest):
    _, depth = case
    rate = 2.0 * math.pi * fastest
    assert rate * depth / 2.0 < limits.max_velocity
    assert rate**2 * depth / 2.0 < limits.max_acceleration


def test_a_stop_from_full_speed_at_the_soft_limit_ends_before_the_hard_one(case, scale):
    limits = simulated_rig_limits(*case, scale, 2.0, COMPLIANCE)
    stopping = limits.max_velocity**2 / (2.0 * limits.max_acceleration)
    assert stopping < limits.hard_position[1] - limits.soft_position[1]


def test_the_master_moves_by_the_scale_and_stops_together_with_the_slave(limits, scale):
    assert limits.max_master_velocity == pytest.approx(limits.max_velocity / scale)
    assert limits.max_velocity / limits.max_acceleration == pytest.approx(
        limits.max_master_velocity / limits.max_master_acceleration
    )


def test_a_frozen_encoder_is_detected_before_the_following_error(limits, scale):
    slave = limits.channels["slave_position"].frozen_travel
    assert slave < limits.following_error
    assert 0.0 < limits.channels["slave_velocity"].frozen_travel < limits.max_velocity
    assert limits.channels["master_position"].frozen_travel == pytest.approx(slave / scale)
    assert limits.channels["contact_force"].frozen_travel == math.inf


def test_rest_velocity_and_following_error_are_small(limits, case):
    _, depth = case
    assert limits.rest_velocity == pytest.approx(0.02 * limits.max_velocity)
    assert limits.drive_compliance == COMPLIANCE
    assert 0.05 * depth < limits.following_error < limits.hard_position[1] - limits.soft_position[1]


def test_friction_lets_the_drive_fall_behind_by_its_compliance(case):
    without = simulated_rig_limits(*case, 1.0, 2.0, COMPLIANCE)
    limits = simulated_rig_limits(*case, 1.0, 2.0, COMPLIANCE, Transmission(60e-6, 4e-6))
    assert limits.following_error - without.following_error == pytest.approx(15.0 * COMPLIANCE)


def test_all_lengths_grow_with_the_depth():
    cube = CUBES["soft"]
    one, two = (simulated_rig_limits(cube, depth, 1.0, 2.0, COMPLIANCE) for depth in (5e-3, 10e-3))
    for name in ("max_velocity", "max_acceleration", "following_error", "rest_velocity"):
        assert getattr(two, name) == pytest.approx(2.0 * getattr(one, name)), name
    assert two.hard_position == pytest.approx([2.0 * x for x in one.hard_position])


def test_the_speed_increases_with_the_excitation_only_at_high_frequencies():
    cube = CUBES["medium"]
    speeds = [
        simulated_rig_limits(cube, 7e-3, 1.0, f, COMPLIANCE).max_velocity for f in (0.1, 2.0, 10.0)
    ]
    assert speeds[0] == speeds[1] < speeds[2]


@pytest.mark.parametrize("depth", [0.0, -1e-3, math.nan, math.inf])
def test_an_invalid_depth_is_refused(depth):
    with pytest.raises(ValueError, match="must be positive|must lie within"):
        simulated_rig_limits(CUBES["soft"], depth, 1.0, 2.0, COMPLIANCE)
