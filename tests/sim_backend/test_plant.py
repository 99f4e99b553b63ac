from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drivers import Command
from sim_backend import ARM, CUBES, Cube, Intention, Plant, PlantParameters
from sim_backend.plant import MAX_STEP

PARAMETERS = PlantParameters(contact_force_lag=14.9e-3)
TICK = 1e-3


def commands(n):
    """Simulate a slave that enters and leaves the hard cube, and a handle that oscillates."""
    for i in range(n):
        t = i * TICK
        yield (
            Command(0.05 * math.cos(3.0 * t), 2.4e-3 * 0.5 * 9.0 * math.sin(9.0 * t)),
            Intention(0.02 * math.sin(3.0 * (t + TICK)), 0.06 * math.cos(3.0 * (t + TICK))),
        )


def readings(plant):
    return (
        plant.handle.x,
        plant.slave.x,
        plant.slave.v,
        plant.master_force.y,
        plant.contact_force.y,
    )


def test_equals_an_ode_solver_on_the_stated_equations():
    cube, p = CUBES["hard"], PARAMETERS
    plant = Plant(cube, p, ARM)
    proportional = 2 * math.pi * p.slave_bandwidth
    integral = proportional * 2 * math.pi * p.slave_integral

    def derivative(time, y, command, ramp):
        _, v_m, x_s, v_s, error, hand, contact = y
        force = cube.k1 * x_s + cube.k3 * x_s**3 + cube.b * v_s
        servo = proportional * (command.slave_velocity - v_s) + integral * error
        return [
            v_m,
            2 * math.pi * p.handle_bandwidth * (command.master_velocity - v_m),
            v_s,
            servo - force / p.slave_mass,
            command.slave_velocity - v_s,
            (ramp(time) - hand) / p.master_force_lag,
            (force - contact) / p.contact_force_lag,
        ]

    y = np.zeros(7)
    hand_before = 0.0
    worst = np.zeros(5)
    for command, intended in commands(600):
        plant.advance(TICK, command, intended)
        hand = ARM.force(intended, plant.handle)
        slope = (hand - hand_before) / TICK
        ramp = lambda s, start=hand_before, slope=slope: start + slope * s  # noqa: E731
        solution = solve_ivp(
            derivative, (0.0, TICK), y, args=(command, ramp), rtol=1e-9, atol=1e-12, method="LSODA"
        )
        y, hand_before = solution.y[:, -1], hand
        expected = (y[0], y[2], y[3], y[5], y[6])
        worst = np.maximum(worst, np.abs(np.subtract(readings(plant), expected)))
    encoder, velocity, noise = 1e-6, 1e-4, 0.02
    assert (worst < np.array([encoder, encoder, velocity, noise, noise]) / 10.0).all(), worst


def test_half_the_step_changes_less_than_a_sensor_resolves():
    coarse = Plant(CUBES["hard"], PARAMETERS, ARM)
    fine = Plant(CUBES["hard"], PARAMETERS, ARM, max_step=MAX_STEP / 2.0)
    for command, intended in commands(2000):
        coarse.advance(TICK, command, intended)
        fine.advance(TICK, command, intended)
        difference = np.abs(np.subtract(readings(coarse), readings(fine)))
        assert (difference < [1e-9, 1e-8, 1e-6, 1e-3, 2e-3]).all()


def test_a_long_step_is_cut_into_short_ones():
    once, often = (Plant(CUBES["soft"], PARAMETERS) for _ in range(2))
    once.advance(0.05, Command(0.0, 0.02))
    for _ in range(50):
        often.advance(1e-3, Command(0.0, 0.02))
    np.testing.assert_allclose(readings(once), readings(often), rtol=1e-9, atol=1e-12)


def test_the_slave_follows_its_command_against_a_hard_cube():
    plant = Plant(Cube(k1=14410.0, k3=5.74e9, b=20.0), PARAMETERS)
    travelled = 0.0
    for i in range(1000):
        u = 2e-3 * math.pi * math.sin(2 * math.pi * i * TICK) * 0.5
        plant.advance(TICK, Command(0.0, u))
        travelled += u * TICK
        assert plant.slave.x == pytest.approx(travelled, abs=0.2e-3)


def test_a_force_channel_lags_a_ramp_by_its_time_constant():
    plant = Plant(Cube(1000.0, 0.0, 1e-6), PlantParameters(contact_force_lag=0.01))
    for _ in range(1000):
        plant.advance(TICK, Command(0.0, 0.01))
    lag = 1000.0 * plant.slave.v * 0.01
    assert plant.slave.force - plant.contact_force.y == pytest.approx(lag, rel=1e-3)


def test_glued_contact_pulls():
    assert Cube(1000.0, 1e6, 1.0).force(-1e-3, 0.0) == pytest.approx(-1.001)


@pytest.mark.parametrize(
    "values", [(0.0, 0.0, 1.0), (1.0, -1.0, 1.0), (1.0, 0.0, 0.0), (math.nan, 0.0, 1.0)]
)
def test_an_impossible_cube_is_refused(values):
    with pytest.raises(ValueError, match="k1 > 0"):
        Cube(*values)


def test_an_impossible_drive_is_refused():
    with pytest.raises(ValueError, match="slave_mass must be positive"):
        PlantParameters(slave_mass=0.0)


def test_a_cube_that_is_not_glued_lets_go_and_never_pulls():
    loose, glued = Cube(2000.0, 0.0, 30.0, glued=False), Cube(2000.0, 0.0, 30.0)
    assert loose.force(1e-3, 0.01) == glued.force(1e-3, 0.01) == pytest.approx(2.3)
    assert loose.force(-1e-3, 0.01) == 0.0
    assert glued.force(1e-3, -0.1) < 0.0
    assert loose.force(1e-3, -0.1) == 0.0
