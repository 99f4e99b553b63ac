from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from teleop.control.admittance import Admittance, AdmittanceParameters, Environment

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


def test_critical_damping_gives_the_exact_solution():
    critical = Admittance(AdmittanceParameters(1.0, 20.0, 100.0))
    near = Admittance(AdmittanceParameters(1.0, 20.0, 100.0 + 1e-7))
    for _ in range(100):
        assert critical.step(1.0, 1e-3) == pytest.approx(near.step(1.0, 1e-3), rel=1e-6)


def test_a_long_pause_does_not_overflow():
    admittance = Admittance(AdmittanceParameters(0.5, 1000.0, 10.0))
    admittance.step(5.0, 1e5)
    assert admittance.position == pytest.approx(0.5)


@given(m=masses, d=dampings, c=stiffnesses, dt=periods)
def test_two_half_periods_give_the_result_of_one_period(m, d, c, dt):
    once, twice = (Admittance(AdmittanceParameters(m, d, c)) for _ in range(2))
    once.step(3.0, dt)
    twice.step(3.0, dt / 2)
    twice.step(3.0, dt / 2)
    assert twice.velocity == pytest.approx(once.velocity, rel=1e-6, abs=1e-9)


def test_a_steady_force_ends_in_the_velocity_that_damping_allows():
    admittance = Admittance(AdmittanceParameters(0.5, 15.0))
    for _ in range(1000):
        admittance.step(3.0, 1e-3)
    assert admittance.velocity == pytest.approx(0.2)


@pytest.mark.parametrize(
    "make",
    [
        lambda: AdmittanceParameters(mass=0.0),
        lambda: AdmittanceParameters(damping=-1.0),
        lambda: AdmittanceParameters(stiffness=-1.0),
        lambda: AdmittanceParameters(stiffness=float("nan")),
    ],
)
def test_a_parameter_out_of_range_is_refused(make):
    with pytest.raises(ValueError, match=r"must be|>= 0"):
        make()


def test_after_follow_the_admittance_continues_from_the_applied_velocity():
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


FORCES = st.lists(st.floats(-15.0, 15.0), min_size=1, max_size=6)


@given(FORCES, st.floats(0.0, 30e3), st.floats(0.0, 2e9), st.floats(0.0, 20.0))
def test_a_body_moves_the_mass_as_the_differential_equation_says(forces, k, k3, b):
    parameters = AdmittanceParameters(0.5, 15.0)
    admittance, body = Admittance(parameters), Environment(k, k3, b)
    state, size = [0.0, 0.0], 1e-4
    for force in forces:
        for _ in range(20):
            admittance.step_against(force, body, 1e-3)

        def rate(t, y, f=force):
            return [y[1], (f - (15.0 + b) * y[1] - k * y[0] - k3 * y[0] ** 3) / 0.5]

        motion = solve_ivp(rate, (0.0, 0.02), state, rtol=1e-9, atol=1e-12).y
        state, size = motion[:, -1], max(size, float(np.max(np.abs(motion[0]))))
    assert admittance.position == pytest.approx(state[0], abs=0.03 * size)


@given(st.floats(-10.0, 10.0), st.floats(1.0, 1e5), st.floats(0.0, 30.0))
def test_a_linear_body_is_a_spring_of_the_admittance(force, k, b):
    sprung = Admittance(AdmittanceParameters(0.5, 15.0 + b, k))
    against = Admittance(AdmittanceParameters(0.5, 15.0))
    for _ in range(50):
        sprung.step(force, 1e-3)
        against.step_against(force, Environment(k, 0.0, b), 1e-3)
    assert against.position == pytest.approx(sprung.position, rel=1e-9, abs=1e-15)
    assert against.velocity == pytest.approx(sprung.velocity, rel=1e-9, abs=1e-12)


def test_a_body_that_is_not_glued_acts_only_at_positive_positions():
    free, against = (Admittance(AdmittanceParameters()) for _ in range(2))
    body = Environment(1e4, 0.0, 5.0, glued=False)
    for _ in range(100):
        free.step(-3.0, 1e-3)
        against.step_against(-3.0, body, 1e-3)
    assert against.position == pytest.approx(free.position, rel=1e-2)


def test_a_negligible_stiffness_does_not_change_the_motion():
    free, against = (Admittance(AdmittanceParameters()) for _ in range(2))
    for _ in range(100):
        free.step(3.0, 1e-3)
        against.step_against(3.0, Environment(1e-140), 1e-3)
    assert against.position == free.position
