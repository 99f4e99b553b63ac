"""Bodies that relax, that are not glued, or that change."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from drivers import Command
from sim_backend import Changing, Cube, Plant, PlantParameters, Relaxing, Transmission

CUBE = Cube(2000.0, 1e6, 3.0)
LOOSE = Cube(2000.0, 1e6, 3.0, glued=False)
DT = 1e-3

cubes = st.builds(
    Cube,
    st.floats(200.0, 2e4),
    st.floats(0.0, 1e9),
    st.floats(0.1, 50.0),
    st.booleans(),
)
relaxing = st.builds(Relaxing, cubes, st.floats(50.0, 2e4), st.floats(0.01, 10.0))
twice_relaxing = st.builds(Relaxing, relaxing, st.floats(50.0, 2e4), st.floats(0.01, 10.0))
passive = st.one_of(cubes, relaxing, twice_relaxing)
strokes = st.lists(
    st.tuples(st.integers(-4, 12).map(lambda mm: mm * 1e-3), st.integers(50, 300)),
    min_size=1,
    max_size=8,
)
"""Turning points of a motion [m], each with the number of steps to it.

A step is short compared with the indentation, so that the integral of the force is accurate.
"""


class Driven:
    """A body whose surface is moved by a plate."""

    def __init__(self, body):
        self.body, self.state = body, body.initial
        self.x = 0.0

    def force(self, v):
        return self.body.law(self.state).force(self.x, v)

    def move(self, x, dt=DT):
        self.x = x
        surface = self.body.law(self.state).surface(x)
        self.state = self.body.advanced(self.state, surface, dt)


def moved(body, points):
    """Yield the force at the beginning, middle and end of each step, and its displacement [m]."""
    driven = Driven(body)
    for target, steps in points:
        start = driven.x
        v = (target - start) / (steps * DT)
        for i in range(steps):
            forces = [driven.force(v)]
            for part in (0.5, 1.0):
                driven.move(start + (i + part) / steps * (target - start), 0.5 * DT)
                forces.append(driven.force(v))
            yield *forces, v * DT


@given(relaxing, strokes)
@settings(deadline=None, max_examples=30)
def test_a_maxwell_branch_equals_an_ode_solver(body, points):
    body = Relaxing(Cube(body.body.k1, body.body.k3, body.body.b), body.k, body.tau)
    z, scale = 0.0, 1e-9
    driven = Driven(body)
    for target, steps in points:
        start = driven.x
        v = (target - start) / (steps * DT)
        solution = solve_ivp(
            lambda t, y, x=start, v=v: (x + v * t - y) / body.tau,
            (0.0, steps * DT),
            [z],
            rtol=1e-10,
            atol=1e-14,
        )
        z = solution.y[0, -1]
        for i in range(steps):
            driven.move(start + (i + 1) / steps * (target - start))
        scale = max(scale, body.k * abs(target))
        expected = body.body.force(driven.x, v) + body.k * (driven.x - z)
        assert driven.force(v) == pytest.approx(expected, abs=1e-6 * scale, rel=1e-9)


def test_a_relaxing_body_in_the_plant_equals_an_ode_solver():
    body, p = Relaxing(CUBE, 3000.0, 0.1), PlantParameters(contact_force_lag=5e-3)
    plant = Plant(body, p)
    proportional = 2 * math.pi * p.slave_bandwidth
    integral = proportional * 2 * math.pi * p.slave_integral

    def derivative(t, y, command):
        x, v, error, z, contact = y
        force = CUBE.force(x, v) + body.k * (x - z)
        servo = proportional * (command - v) + integral * error
        return [
            v,
            servo - force / p.slave_mass,
            command - v,
            (x - z) / body.tau,
            (force - contact) / p.contact_force_lag,
        ]

    y, worst = np.zeros(5), np.zeros(3)
    for i in range(600):
        command = 0.02 * math.cos(9.0 * i * DT)
        plant.advance(DT, Command(0.0, command))
        solution = solve_ivp(derivative, (0.0, DT), y, args=(command,), rtol=1e-9, atol=1e-12)
        y = solution.y[:, -1]
        readings = (plant.slave.x, plant.slave.v, plant.contact_force.y)
        worst = np.maximum(worst, np.abs(np.subtract(readings, (y[0], y[1], y[4]))))
    encoder, velocity, noise = 1e-6, 1e-4, 0.02
    assert (worst < np.array([encoder, velocity, noise]) / 10.0).all(), worst


def test_a_held_indentation_relaxes_to_the_slow_force():
    driven = Driven(Relaxing(CUBE, 3000.0, 0.1))
    driven.move(5e-3)
    assert driven.force(0.0) == pytest.approx(CUBE.force(5e-3, 0.0) + 15.0, rel=0.02)
    for _ in range(1000):
        driven.move(5e-3)
    slow = driven.body.slow.force(5e-3, 0.0)
    assert driven.force(0.0) == pytest.approx(slow, rel=1e-3)
    assert slow == CUBE.force(5e-3, 0.0)


def test_in_slow_motion_a_branch_is_a_damping():
    body = Relaxing(CUBE, 3000.0, 0.02)
    *_, (_, _, force, step) = moved(body, [(4e-3, 4000)])
    assert force == pytest.approx(body.slow.force(4e-3, step / DT), rel=1e-9)


@given(passive, strokes)
@settings(deadline=None, max_examples=20)
def test_a_body_that_does_not_change_never_gives_energy(body, points):
    energy, peak = 0.0, 0.0
    for before, middle, after, step in moved(body, points):
        energy += (before + 4.0 * middle + after) / 6.0 * step  # Simpson: exact for a cube
        peak = max(peak, energy)
        assert energy >= -2e-3 * peak - 1e-12


@given(st.one_of(relaxing, twice_relaxing, cubes), strokes)
@settings(deadline=None, max_examples=20)
def test_a_body_that_is_not_glued_never_pulls(body, points):
    def loose(one):
        if isinstance(one, Relaxing):
            return Relaxing(loose(one.body), one.k, one.tau)
        return Cube(one.k1, one.k3, one.b, glued=False)

    assert all(min(forces) >= 0.0 for *forces, _ in moved(loose(body), points))


def test_a_relaxing_body_that_is_not_glued_loses_contact_above_its_first_surface_and_recovers():
    driven = Driven(Relaxing(LOOSE, 6000.0, 0.2))
    for _ in range(400):
        driven.move(5e-3)
    for i in range(40):
        driven.move(5e-3 - i * 0.1e-3)
    assert driven.x > 0.5e-3
    assert driven.force(-0.1) == 0.0
    remaining = driven.body.law(driven.state).rest
    assert remaining > driven.x
    for _ in range(2000):
        driven.move(driven.x)
    assert driven.force(0.0) > 0.0
    for _ in range(8000):
        driven.move(-1e-3)
    assert driven.body.law(driven.state).rest == pytest.approx(0.0, abs=1e-5)


def test_a_specimen_is_replaced_at_the_beginning_of_a_contact():
    hard = Cube(8000.0, 0.0, 3.0, glued=False)
    body = Changing(LOOSE, hard, contact=2)
    forces = [after for _, _, after, _ in moved(body, [(2e-3, 100), (-2e-3, 200), (2e-3, 200)])]
    assert forces[99] == pytest.approx(LOOSE.force(2e-3, 0.02))
    assert forces[149] == pytest.approx(LOOSE.force(1e-3, -0.02))
    assert forces[-1] == pytest.approx(hard.force(2e-3, 0.02))
    assert body.slow == LOOSE


def test_a_short_loss_of_contact_does_not_begin_a_new_contact():
    body = Changing(LOOSE, Cube(8000.0, 0.0, 3.0, glued=False), contact=2)
    forces = [after for _, _, after, _ in moved(body, [(2e-3, 100), (-1e-4, 100), (2e-3, 100)])]
    assert forces[-1] == pytest.approx(LOOSE.force(2e-3, 0.021))


def test_a_glued_body_stiffens_while_it_is_indented_after_a_delay():
    hard = Cube(8000.0, 0.0, 3.0)
    driven = Driven(Changing(CUBE, hard, delay=0.5))
    for _ in range(400):
        driven.move(0.0)
    forces = []
    for _ in range(1000):
        driven.move(2e-3)
        forces.append(driven.force(0.0))
    soft, stiff = CUBE.force(2e-3, 0.0), hard.force(2e-3, 0.0)
    change = forces.index(stiff)
    assert change * DT == pytest.approx(0.5, abs=3 * DT)
    assert set(forces[:change]) == {soft}
    assert set(forces[change:]) == {stiff}


def test_two_simulations_of_one_body_are_independent():
    body = Relaxing(CUBE, 3000.0, 0.1)
    first, second = Driven(body), Driven(body)
    for _ in range(100):
        first.move(5e-3)
    second.move(5e-3)
    assert second.force(0.0) > first.force(0.0) + 5.0


@given(passive, st.floats(-3e-3, 10e-3), st.floats(0.0, 1e-4))
@settings(deadline=None, max_examples=20)
def test_a_body_in_series_with_a_transmission_is_in_equilibrium(body, x, compliance):
    driven = Driven(body)
    for _ in range(50):
        driven.move(4e-3)
    law = body.law(driven.state)
    y = law.compressed(x, compliance)
    assert y + compliance * law.force(y, 0.0) == pytest.approx(x, abs=1e-12, rel=1e-9)


def test_the_plant_moves_a_relaxing_body_by_its_tip_not_by_its_motor():
    transmission = Transmission(compliance=1e-4)
    plant = Plant(Relaxing(CUBE, 3000.0, 0.05), PlantParameters(transmission=transmission))
    for _ in range(1000):
        plant.advance(DT, Command(0.0, 5e-3))
    for _ in range(1000):
        plant.advance(DT, Command(0.0, 0.0))
    x = plant.slave.x
    tip = CUBE.compressed(x, 1e-4)
    assert x - tip > 0.5e-3
    assert plant.slave.force == pytest.approx(CUBE.force(tip, 0.0), rel=1e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Relaxing(CUBE, 0.0, 1.0), "a relaxing body needs k > 0, got 0 N/m"),
        (lambda: Relaxing(CUBE, 100.0, 1e-3), "tau >= 0.01 s, got 0.001 s"),
        (lambda: Relaxing(CUBE, 100.0, math.nan), "tau >= 0.01 s, got nan s"),
        (lambda: Changing(CUBE, LOOSE, delay=1.0), "the same `glued`"),
        (lambda: Changing(CUBE, CUBE), "contact > 1 or delay > 0"),
        (lambda: Changing(CUBE, CUBE, contact=2), "a glued body has one contact"),
        (lambda: Changing(LOOSE, LOOSE, contact=0), "contact >= 1"),
        (lambda: Changing(LOOSE, LOOSE, delay=math.inf), "delay >= 0"),
    ],
)
def test_an_impossible_body_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
