from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from drivers import Command
from teleop.control.admittance import Admittance, AdmittanceParameters, Coupling

masses = st.floats(0.05, 10.0)
dampings = st.floats(0.1, 100.0)
stiffnesses = st.one_of(st.just(0.0), st.floats(0.1, 5000.0))
periods = st.floats(1e-4, 0.1)


@given(m=masses, d=dampings, c=stiffnesses, dt=periods, force=st.floats(-20, 20))
def test_is_the_matrix_exponential_of_the_virtual_dynamics(m, d, c, dt, force):
    admittance = Admittance(AdmittanceParameters(m, d, c))
    system = np.zeros((3, 3))
    system[0, 1] = 1.0
    system[1] = [-c / m, -d / m, force / m]
    state = np.array([0.0, 0.0, 1.0])
    for _ in range(5):
        admittance.step(force, dt)
        state = expm(system * dt) @ state
        np.testing.assert_allclose(
            (admittance.position, admittance.velocity), state[:2], rtol=1e-6, atol=1e-9
        )


def test_critical_damping_is_no_exception():
    critical = Admittance(AdmittanceParameters(1.0, 20.0, 100.0))
    near = Admittance(AdmittanceParameters(1.0, 20.0, 100.0 + 1e-7))
    for _ in range(100):
        assert critical.step(1.0, 1e-3) == pytest.approx(near.step(1.0, 1e-3), rel=1e-6)


def test_a_long_pause_overflows_nothing():
    admittance = Admittance(AdmittanceParameters(0.5, 1000.0, 10.0))
    admittance.step(5.0, 1e5)
    assert admittance.position == pytest.approx(0.5)


@given(m=masses, d=dampings, c=stiffnesses, dt=periods)
def test_one_period_is_the_same_as_its_halves(m, d, c, dt):
    once, twice = (Admittance(AdmittanceParameters(m, d, c)) for _ in range(2))
    once.step(3.0, dt)
    twice.step(3.0, dt / 2)
    twice.step(3.0, dt / 2)
    assert twice.velocity == pytest.approx(once.velocity, rel=1e-6, abs=1e-9)


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
    admittance.align(slave, coupling)
    for _ in range(5):
        assert coupling.command(admittance, slave) == pytest.approx((0.0, 0.0), abs=1e-12)
        admittance.step(0.0, 0.01)


@given(c=stiffnesses, slave=st.floats(-0.5, 0.5), force=st.floats(-20, 20))
def test_alignment_moves_the_centre_along_and_changes_no_velocity(c, slave, force):
    aligned, fresh = (Admittance(AdmittanceParameters(0.5, 15.0, c)) for _ in range(2))
    aligned.align(slave, Coupling())
    for _ in range(5):
        velocity = fresh.step(force, 0.01)
        assert aligned.step(force, 0.01) == pytest.approx(velocity, rel=1e-6, abs=1e-9)


def test_a_steady_force_ends_in_the_velocity_that_damping_allows():
    admittance = Admittance(AdmittanceParameters(0.5, 15.0))
    for _ in range(1000):
        admittance.step(3.0, 1e-3)
    assert admittance.velocity == pytest.approx(0.2)


def test_velocity_coupling_scales_velocity_alone():
    master = Admittance(AdmittanceParameters())
    master.position, master.velocity = 0.01, 0.1
    assert Coupling(0.5).command(master, slave_position=0.0) == Command(0.1, 0.05)


def test_position_coupling_makes_up_for_a_difference_in_position():
    master = Admittance(AdmittanceParameters())
    master.position, master.velocity = 0.01, 0.1
    command = Coupling(0.5, position_gain=10.0).command(master, slave_position=0.002)
    assert command.slave_velocity == pytest.approx(0.05 + 10.0 * 0.003)


@pytest.mark.parametrize(
    "make",
    [
        lambda: AdmittanceParameters(mass=0.0),
        lambda: AdmittanceParameters(damping=-1.0),
        lambda: AdmittanceParameters(stiffness=-1.0),
        lambda: AdmittanceParameters(stiffness=float("nan")),
        lambda: Coupling(0.0),
        lambda: Coupling(1.0, -1.0),
    ],
)
def test_a_parameter_out_of_range_is_refused(make):
    with pytest.raises(ValueError, match=r"must be|>= 0"):
        make()


def test_an_admittance_that_is_told_what_was_applied_goes_on_from_there():
    admittance = Admittance(AdmittanceParameters())
    admittance.step(10.0, 1e-3)
    before = admittance.position
    wanted = admittance.velocity
    admittance.follow(0.25 * wanted, 1e-3)
    assert admittance.velocity == 0.25 * wanted
    assert admittance.position == pytest.approx(before - 0.75 * wanted * 1e-3)
    fresh = Admittance(AdmittanceParameters())
    fresh.velocity = 0.25 * wanted
    assert admittance.step(3.0, 1e-3) == fresh.step(3.0, 1e-3)
