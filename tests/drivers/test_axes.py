"""Axes make every kind of drive follow a commanded velocity, and stop it without force."""

from __future__ import annotations

import math

import pytest

from drivers.axes import CoupledAxis, DeviceCoupledAxis, PositionAxis, VelocityAxis, make_axis
from drivers.coupling import CouplingParameters
from drivers.device import ForceDrive, ImpedanceDrive, PositionDrive, Sample, VelocityDrive

PERIOD = 1e-3
COUPLING = CouplingParameters(500.0, max_force=10.0, friction=1.0)


class Recorded:
    """A drive that stores its commands and is in operation once it was enabled."""

    def __init__(self):
        self.commands = []
        self.operates = False

    def enable(self):
        self.operates = True
        return True

    def idle(self):
        self.operates = False
        return True

    def command(self, *values):
        self.commands.append(values)
        return values[0] if len(values) == 1 else values[:2]


class Velocities(Recorded, VelocityDrive): ...


class Positions(Recorded, PositionDrive): ...


class Forces(Recorded, ForceDrive): ...


class Impedances(Recorded, ImpedanceDrive): ...


def axis_of(drive, sign=1, reading=lambda: 0.25, coupling=COUPLING):
    return make_axis(drive, sign, reading, coupling, 5e-3, 0.4, 0.02)


def test_each_kind_of_drive_gets_its_axis():
    kinds = {
        Velocities: VelocityAxis,
        Positions: PositionAxis,
        Forces: CoupledAxis,
        Impedances: DeviceCoupledAxis,
    }
    for drive, axis in kinds.items():
        assert type(axis_of(drive())) is axis
    with pytest.raises(ValueError, match="virtual coupling"):
        axis_of(Forces(), coupling=None)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_position_drive_receives_the_integral_from_its_present_position(sign):
    drive = Positions()
    axis = axis_of(drive, sign)
    assert axis.command(0.1, 0.0) == 0.0
    assert not drive.commands
    assert axis.enable()
    for k in range(11):
        assert axis.command(0.1, k * PERIOD) == 0.1
    assert drive.commands[0] == (0.25,)
    assert drive.commands[-1][0] == pytest.approx(0.25 + sign * 0.1 * 10 * PERIOD)
    axis.command(0.1, 5.0)  # an interruption of the loop
    assert drive.commands[-1][0] == pytest.approx(0.25 + sign * 0.1 * (10 * PERIOD + 0.02))
    axis.idle()
    assert axis.enable()
    assert drive.commands[-1] == (0.25,)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_force_drive_pushes_against_the_displacement_of_its_part(sign):
    drive = Forces()
    axis = axis_of(drive, sign)
    axis.measure(Sample(0.0, 0.0))
    axis.measure(Sample(0.0, PERIOD))
    assert axis.enable()
    for k in range(2, 22):  # the hand moves by 0.1 mm in each period
        axis.measure(Sample((k - 1) * 1e-4, k * PERIOD))
    axis.command(0.0, 22 * PERIOD)
    assert axis.force == pytest.approx(500.0 * 20e-4)
    assert drive.commands[-1][0] == pytest.approx(-sign * 1.0)
    axis.idle()
    assert drive.commands[-1] == (0.0,)
    assert axis.force == pytest.approx(1.0)
    axis.measure(Sample(0.01, 0.1))
    assert axis.force == 0.0


def test_a_moving_part_is_not_enabled_and_the_reason_is_stated():
    drive = Forces()
    axis = axis_of(drive)
    for k in range(100):
        axis.measure(Sample(k * 1e-4, k * PERIOD))
    assert not axis.enable()
    assert not drive.operates
    assert axis.waits_for == "a speed below 5 mm/s"
    for k in range(100, 200):
        axis.measure(Sample(99e-4, k * PERIOD))
    assert axis.enable()


def test_a_part_that_moves_too_fast_in_operation_is_an_error():
    axis = axis_of(Forces(), coupling=CouplingParameters(1.0, max_force=10.0, friction=1.0))
    axis.measure(Sample(0.0, 0.0))
    axis.measure(Sample(0.0, PERIOD))
    axis.enable()
    for k in range(2, 40):
        axis.measure(Sample(k * 1e-3, k * PERIOD))
    assert "at most 400 mm/s" in axis.error
    axis.idle()
    axis.measure(Sample(0.039, 0.2))
    assert "at most 400 mm/s" in axis.error  # until a person arms again
    axis.rearm()
    axis.measure(Sample(0.039, 0.3))
    assert axis.error == ""


@pytest.mark.parametrize("sign", [1, -1])
def test_a_drive_with_its_own_coupling_receives_the_proxy_on_its_scale(sign):
    drive = Impedances()
    part = 0.0
    axis = axis_of(drive, sign, reading=lambda: 0.25 + sign * part)
    axis.measure(Sample(part, 0.0))
    axis.measure(Sample(part, PERIOD))
    assert axis.enable()
    axis.command(0.05, PERIOD)
    for k in range(2, 12):
        part = (k - 1) * 2e-5
        axis.measure(Sample(part, k * PERIOD))
        axis.command(0.05, k * PERIOD)
    position, velocity, stiffness, damping = drive.commands[-1]
    assert position == pytest.approx(0.25 + sign * 0.05 * 10 * PERIOD)
    assert (velocity, stiffness, damping) == (sign * 0.05, 500.0, 0.0)
    assert axis.force == pytest.approx(500.0 * (2e-4 - 5e-4))
    axis.idle()
    assert drive.commands[-1][1:] == (0.0, 0.0, 0.0)


def test_a_velocity_drive_has_no_coupling():
    drive = Velocities()
    axis = axis_of(drive, -1)
    assert axis.command(0.2, 0.0) == 0.2
    assert drive.commands == [(-0.2,)]
    assert math.isnan(axis.force)


class Coarse(Impedances):
    """A drive that applies multiples of 100 N/m only."""

    def rounded(self, stiffness, damping):
        return 100.0 * round(stiffness / 100.0), damping


def test_a_drive_with_its_own_coupling_receives_the_gains_that_it_can_apply():
    drive = Coarse()
    axis = axis_of(drive, coupling=CouplingParameters(950.0, max_force=5.0))
    assert axis.coupling.parameters.stiffness == 1000.0
    axis.measure(Sample(0.0, 0.0))
    axis.measure(Sample(0.0, PERIOD))
    axis.enable()
    axis.command(0.1, PERIOD)
    assert drive.commands[-1][2] == 1000.0


@pytest.mark.parametrize("sign", [1, -1])
def test_its_reference_is_at_most_where_its_spring_has_the_largest_force(sign):
    drive = Impedances()
    axis = axis_of(drive, sign)
    axis.measure(Sample(0.0, 0.0))
    axis.measure(Sample(0.0, PERIOD))
    axis.enable()
    for k in range(2, 400):
        axis.command(0.1, k * PERIOD)
        axis.measure(Sample(0.0, k * PERIOD))
        assert abs(500.0 * (drive.commands[-1][0] - 0.25)) <= 10.0 * (1 + 1e-9)
    assert 500.0 * (drive.commands[-1][0] - 0.25) == pytest.approx(sign * 10.0)


class Stepped(Positions):
    """A drive with a resolution of 10 um that goes to 1 mm."""

    def command(self, position):
        return super().command(1e-5 * round(1e5 * min(position, 1e-3)))


def test_the_rounding_of_a_position_drive_does_not_accumulate_and_its_limit_holds():
    drive = Stepped()
    axis = axis_of(drive, reading=lambda: 0.0)
    axis.enable()
    for k in range(101):
        axis.command(2e-3, k * PERIOD)  # 2 um per period
    assert drive.commands[-1][0] == pytest.approx(0.2e-3)
    for k in range(101, 1000):
        axis.command(2e-3, k * PERIOD)
    for k in range(1000, 1100):
        axis.command(-2e-3, k * PERIOD)
    assert drive.commands[-1][0] == pytest.approx(0.9e-3, abs=1e-5)


def test_a_position_drive_starts_where_it_goes_into_operation():
    drive, position = Positions(), 0.1
    axis = axis_of(drive, reading=lambda: position)
    drive.enable = lambda: position > 0.3
    assert not axis.enable()
    position = 0.35
    assert axis.enable()
    axis.command(0.0, 0.0)
    assert drive.commands[-1] == (0.35,)
