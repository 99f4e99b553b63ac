"""The observed energy at the port of the hand."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from teleop.control.admittance import Admittance, AdmittanceParameters, Environment
from teleop.control.feedback.port_energy import PortEnergy

DT = 1e-3
FORCES = st.lists(st.floats(-15.0, 15.0), min_size=1, max_size=30)


@given(FORCES, st.floats(0.0, 30e3), st.floats(0.0, 20.0))
def test_a_constant_passive_environment_never_gives_energy(forces, k, b):
    admittance, body = Admittance(AdmittanceParameters()), Environment(k, 0.0, b)
    energy = PortEnergy(admittance)
    for force in forces:
        for _ in range(30):
            start = body.force(admittance.position, admittance.velocity)
            admittance.step_against(force, body, DT)
            end = body.force(admittance.position, admittance.velocity)
            assert energy.update(start, end, DT) > -1e-5


def oscillate(delay, seconds, limit=float("inf")):
    """Return the energy after an oscillation against a delayed spring, with limited velocity."""
    admittance = Admittance(AdmittanceParameters())
    admittance.position = 2e-3
    energy, past = PortEnergy(admittance), [0.0] * (delay + 1)
    for n in range(round(seconds / DT)):
        past[n % len(past)] = 2000.0 * admittance.position
        displayed = past[(n + 1) % len(past)]
        start = admittance.position
        velocity = admittance.step(-displayed, DT)
        if abs(velocity) > limit:
            admittance.velocity = limit if velocity > 0.0 else -limit
            admittance.position = start + admittance.velocity * DT
        energy.update(displayed, displayed, DT)
    return energy.energy


def test_an_oscillation_against_a_delayed_spring_gives_energy():
    assert oscillate(0, 2.0) > -1e-3
    assert oscillate(20, 0.5) < -20e-3


def test_an_oscillation_within_the_velocity_limit_is_observed_too():
    assert oscillate(20, 2.0, limit=0.05) < -20e-3


def test_long_damped_motion_does_not_hide_energy_that_is_given_later():
    admittance = Admittance(AdmittanceParameters())
    energy = PortEnergy(admittance)
    for n in range(5000):
        admittance.step(5.0 if n // 500 % 2 else -5.0, DT)
        energy.update(0.0, 0.0, DT)
    assert energy.energy <= 0.5 * 0.5 * (5.0 / 15.0) ** 2 * (1.0 + 1e-9)
