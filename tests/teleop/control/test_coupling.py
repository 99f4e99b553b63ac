"""The coupling from the motion of the master to the slave."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Ages, Command, Measurement
from teleop.control.admittance import Admittance, AdmittanceParameters
from teleop.control.coupling import Coupling

stiffnesses = st.one_of(st.just(0.0), st.floats(0.1, 5000.0))


def at(position: float) -> Measurement:
    """Return a measurement with the slave at a position [m]."""
    return Measurement(0.0, 0.0, 0.0, position, 0.0, 0.0, Ages(*[0.0] * 5))


@given(
    c=stiffnesses,
    scale=st.floats(0.05, 20.0),
    gain=st.floats(0.0, 50.0),
    force=st.floats(-20, 20),
    slave=st.floats(-0.5, 0.5),
)
def test_aligned_with_the_slave_it_commands_nothing_until_a_force_acts(
    c, scale, gain, force, slave
):
    admittance = Admittance(AdmittanceParameters(0.5, 15.0, c))
    coupling = Coupling(scale, gain)
    for _ in range(5):
        admittance.step(force, 0.01)
    coupling.align(admittance, at(slave))
    for _ in range(5):
        assert coupling.command(admittance, at(slave)) == pytest.approx((0.0, 0.0), abs=1e-12)
        admittance.step(0.0, 0.01)


@given(c=stiffnesses, slave=st.floats(-0.5, 0.5), force=st.floats(-20, 20))
def test_alignment_moves_the_centre_along_and_changes_no_velocity(c, slave, force):
    aligned, fresh = (Admittance(AdmittanceParameters(0.5, 15.0, c)) for _ in range(2))
    Coupling().align(aligned, at(slave))
    for _ in range(5):
        velocity = fresh.step(force, 0.01)
        assert aligned.step(force, 0.01) == pytest.approx(velocity, rel=1e-6, abs=1e-9)


def test_velocity_coupling_scales_only_velocity():
    master = Admittance(AdmittanceParameters())
    master.position, master.velocity = 0.01, 0.1
    assert Coupling(0.5).command(master, at(0.0)) == Command(0.1, 0.05)


def test_position_coupling_corrects_a_difference_in_position():
    master = Admittance(AdmittanceParameters())
    master.position, master.velocity = 0.01, 0.1
    command = Coupling(0.5, position_gain=10.0).command(master, at(0.002))
    assert command.slave_velocity == pytest.approx(0.05 + 10.0 * 0.003)


@pytest.mark.parametrize("parameters", [(0.0,), (1.0, -1.0), (float("nan"),)])
def test_a_parameter_out_of_its_range_is_refused(parameters):
    with pytest.raises(ValueError, match="must be"):
        Coupling(*parameters)
