"""Axes of drives that accept forces or positions, or close a coupling themselves."""

from __future__ import annotations

import pytest

from drivers.axes import make_axis
from drivers.coupling import CouplingParameters
from drivers.device import ForceDrive, ImpedanceDrive, PositionDrive, Sample

TICK = 1e-3


class FakeDrive:
    """A drive that stores its commands."""

    def __init__(self):
        self.commands = []

    def enable(self):
        return True

    def idle(self):
        return True


class Impedance(FakeDrive, ImpedanceDrive):
    def rounded(self, stiffness, damping):
        return 100.0 * round(stiffness / 100.0), damping

    def command(self, *values):
        self.commands.append(values)
        return values[:2]


class Force(FakeDrive, ForceDrive):
    def command(self, force):
        self.commands.append(force)
        return force


class Position(FakeDrive, PositionDrive):
    def command(self, position):
        self.commands.append(position)
        return position


def axis_of(drive, sign=1, reading=0.0, **coupling):
    parameters = CouplingParameters(**({"stiffness": 950.0, "max_force": 5.0} | coupling))
    return make_axis(drive, sign, lambda: reading, parameters, 2e-3, 0.5, 0.02)


def at_rest(axis, position=0.0):
    """Measure a position until the axis is enabled; return the time of the last measurement."""
    for i in range(10):
        axis.measure(Sample(position, i * TICK))
    assert axis.enable()
    return 9 * TICK


def test_an_impedance_drive_gets_the_gains_that_it_can_apply():
    drive = Impedance()
    axis = axis_of(drive)
    assert axis.coupling.parameters.stiffness == 1000.0
    time = at_rest(axis)
    axis.command(0.1, time)
    assert drive.commands[-1][2] == 1000.0


@pytest.mark.parametrize("sign", [1, -1])
def test_the_reference_of_an_impedance_drive_is_at_most_where_its_spring_has_the_largest_force(
    sign,
):
    drive = Impedance()
    axis = axis_of(drive, sign, reading=0.3)
    time = at_rest(axis)
    for _ in range(60):
        axis.command(0.1, time)
        time += TICK
        axis.measure(Sample(0.0, time))
        position, velocity, stiffness, _ = drive.commands[-1]
        assert abs(stiffness * (position - 0.3)) <= 5.0 * (1 + 1e-9)
        assert velocity == pytest.approx(sign * 0.1)
    assert stiffness * (position - 0.3) == pytest.approx(sign * 5.0)


def test_an_idle_impedance_drive_has_no_gains():
    drive = Impedance()
    axis = axis_of(drive)
    at_rest(axis)
    axis.idle()
    assert drive.commands[-1] == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_force_drive_pulls_the_moving_part_towards_the_proxy(sign):
    drive = Force()
    axis = axis_of(drive, sign)
    time = at_rest(axis)
    axis.command(0.1, time)
    axis.measure(Sample(0.0, time + TICK))
    axis.command(0.1, time + TICK)
    assert drive.commands[-1] == pytest.approx(sign * 950.0 * 0.1 * TICK)
    assert axis.force == pytest.approx(-950.0 * 0.1 * TICK)


def test_a_position_drive_gets_the_integral_of_the_velocity_from_its_present_position():
    drive = Position()
    axis = make_axis(drive, -1, lambda: 0.25, None, 2e-3, 0.5, 0.02)
    axis.enable()
    for i in range(11):
        axis.command(0.1, i * TICK)
    assert drive.commands[0] == 0.25
    assert drive.commands[-1] == pytest.approx(0.25 - 0.1 * 10 * TICK)
    axis.command(0.1, 5.0)  # after an interruption of the loop
    assert drive.commands[-1] == pytest.approx(0.25 - 0.1 * 10 * TICK - 0.1 * 0.02)


class Coarse(Position):
    """A drive with a resolution of 10 um that goes to 1 mm."""

    def command(self, position):
        return super().command(1e-5 * round(1e5 * min(position, 1e-3)))


def test_the_rounding_of_a_position_drive_does_not_accumulate_and_its_limit_holds():
    drive = Coarse()
    axis = make_axis(drive, 1, lambda: 0.0, None, 2e-3, 0.5, 0.02)
    axis.enable()
    for i in range(101):
        axis.command(2e-3, i * TICK)  # 2 um per period
    assert drive.commands[-1] == pytest.approx(0.2e-3)
    for i in range(101, 1000):
        axis.command(2e-3, i * TICK)
    for i in range(1000, 1100):
        axis.command(-2e-3, i * TICK)
    assert drive.commands[-1] == pytest.approx(0.9e-3, abs=1e-5)
