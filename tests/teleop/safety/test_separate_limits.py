"""Soft limits with a channel: those of the slave act at the slave, those of the master there."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from drivers import Ages, Command, Measurement
from teleop.safety import Limits, Supervision
from teleop.safety.soft_limits import APPROACH_TIME, FORCE, limit_command

LIMITS = Limits(max_acceleration=1e9, max_master_acceleration=1e9)
VELOCITIES = st.floats(-2.0, 2.0)
STATE = Supervision(applied=Command(0.0, 0.0))


def limited(master, slave, x, f, stiffness):
    measurement = Measurement(1.0, 0.0, 0.0, x, f, 0.0, Ages(*[0.0] * 5))
    return limit_command(Command(master, slave), measurement, 10.0, 1e-3, STATE, LIMITS, stiffness)


@given(VELOCITIES, VELOCITIES, st.floats(-0.03, 0.03), st.floats(-90.0, 90.0), st.floats(0.0, 1e5))
def test_no_limit_of_the_slave_changes_the_velocity_of_the_master(master, slave, x, f, stiffness):
    command, _ = limited(master, slave, x, f, stiffness)
    free, _ = limited(master, 0.0, 0.0, 0.0, 0.0)
    assert command.master_velocity == free.master_velocity
    assert abs(command.master_velocity) <= min(abs(master), LIMITS.max_master_velocity)


@given(VELOCITIES, st.floats(-0.02, 0.02), st.floats(-90.0, 90.0), st.floats(1.0, 1e5))
def test_the_approach_keeps_the_expected_force_below_the_soft_limit(slave, x, f, stiffness):
    command, flags = limited(0.0, slave, x, f, stiffness)
    speed = command.slave_velocity
    assert speed * slave >= 0.0
    assert abs(speed) <= abs(slave)
    if speed * f > 0.0 and abs(f) > 0.1:
        assert abs(f) + abs(speed) * stiffness * APPROACH_TIME <= LIMITS.soft_force * (1.0 + 1e-9)
    if abs(f) > LIMITS.soft_force and slave * f > 0.0:
        assert speed == 0.0
        assert flags & FORCE


@given(st.floats(0.01, 2.0), st.floats(61.0, 90.0), st.floats(0.0, 1e5))
def test_the_slave_can_always_leave_the_contact(speed, f, stiffness):
    command, _ = limited(0.0, -speed, 5e-3, f, stiffness)
    assert command.slave_velocity < 0.0


@given(VELOCITIES, VELOCITIES, st.floats(-0.02, 0.02), st.floats(-90.0, 90.0))
def test_without_a_stiffness_master_and_slave_are_reduced_together(master, slave, x, f):
    command, _ = limited(master, slave, x, f, None)
    ratio = command.master_velocity * slave - command.slave_velocity * master
    assert math.isclose(ratio, 0.0, abs_tol=1e-9)
