"""Lost motion between the slave's encoder and its tip."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from drivers import Command
from sim_backend import Cube, Plant, PlantParameters, Setup, Transmission
from sim_backend.plant import Slave

TICK = 1e-3
LINEAR = Cube(5000.0, 0.0, 1e-9)
NO_LAG = 1e-6


def slave(cube, lost_motion=0.0, compliance=0.0):
    transmission = Transmission(lost_motion, compliance)
    return Slave(cube, PlantParameters(transmission=transmission))


def moved(body, positions):
    """Force of the cube at each position of the motor, which passes through them slowly."""
    forces = []
    for before, x in pairwise([0.0, *positions]):
        body.move_to(x, x - before)
        forces.append(body.force)
    return np.array(forces)


def driven(cube, transmission, amplitude, frequency, periods=3):
    """Position, force, and motor force of a plant that is driven by a sine for whole periods."""
    plant = Plant(cube, PlantParameters(transmission=transmission, contact_force_lag=NO_LAG))
    omega = 2.0 * math.pi * frequency
    rows = []
    for i in range(round(periods / frequency / TICK)):
        u = omega * amplitude * math.cos(omega * (i + 0.5) * TICK)
        plant.advance(TICK, Command(0.0, u))
        rows.append(
            (plant.slave.x, plant.slave.force, plant.slave.load(plant.slave.x, plant.slave.v))
        )
    return np.array(rows).T


@settings(max_examples=30)
@given(
    st.floats(500.0, 40e3),
    st.floats(0.0, 0.4),
    st.floats(1e-7, 1e-5),
)
def test_the_force_to_a_sine_has_the_describing_function_of_the_play(k, share, compliance):
    amplitude = 2e-3
    lost = share * amplitude
    angle = np.linspace(0.0, 4.0 * math.pi, 2001)
    force = moved(slave(Cube(k, 0.0, 1e-12), lost, compliance), amplitude * np.sin(angle))
    last = slice(1001, None)
    in_series = k / (1.0 + k * compliance)
    cosine = 2.0 * np.mean(force[last] * np.cos(angle[last])) / (in_series * amplitude)
    sine = 2.0 * np.mean(force[last] * np.sin(angle[last])) / (in_series * amplitude)
    q = 1.0 - 2.0 * share
    assert cosine == pytest.approx(-4.0 * share * (1.0 - share) / math.pi, abs=2e-3)
    expected = 0.5 + (math.asin(q) + q * math.sqrt(1.0 - q * q)) / math.pi
    assert sine == pytest.approx(expected, abs=5e-3)


def test_lost_motion_reads_as_negative_damping_in_the_simulated_plant():
    lost, frequency = 50e-6, 2.0
    transmission = Transmission(lost, 2e-6)
    x, f, _ = driven(LINEAR, transmission, 3e-3, frequency)
    period = round(1.0 / frequency / TICK)
    x, f = x[-period:], f[-period:]
    wave = np.exp(-2j * math.pi * np.arange(period) / period)
    stiffness = np.sum(f * wave) / np.sum(x * wave)
    amplitude = 2.0 * abs(np.sum(x * wave)) / period
    omega = 2.0 * math.pi * frequency
    k = 5000.0 / (1.0 + 5000.0 * 2e-6)
    expected = -4.0 * k * lost * (amplitude - lost) / (math.pi * omega * amplitude**2)
    assert stiffness.imag / omega == pytest.approx(expected, rel=0.03)


@settings(max_examples=30)
@given(
    st.lists(st.integers(-40, 40).map(lambda n: n * 1e-4), min_size=2, max_size=8),
    st.floats(1e-6, 3e-4),
    st.floats(1e-6, 1e-5),
    st.sampled_from([0.0, 1e8, 5e9]),
)
def test_energy_is_never_created(turns, lost, compliance, k3):
    """The motor has always done at least the work that cube and transmission hold as springs."""
    cube = Cube(5000.0, k3, 5.0)
    body = slave(cube, lost, compliance)
    work = most = 0.0
    for start, end in pairwise([0.0, *turns]):
        speed = math.copysign(1e-9, end - start)
        for x in np.linspace(start, end, 200).tolist()[1:]:
            before, step = body.load(body.x, speed), x - body.x
            body.move_to(x, speed)
            work += 0.5 * (before + body.load(x, speed)) * step
        tip = brentq(lambda y, force=body.force: cube.force(y, 0.0) - force, -5e-3, 5e-3)
        stored = 0.5 * cube.k1 * tip**2 + 0.25 * k3 * tip**4
        stored += 0.5 * (body.x - tip) ** 2 / compliance
        most = max(most, stored)
        assert work >= stored - 2e-3 * most - 1e-12


def test_without_lost_motion_and_compliance_nothing_changes():
    cube = Cube(5000.0, 1e8, 5.0)
    body = slave(cube)
    for x, v in ((1e-3, 0.02), (2e-3, -0.03), (1.5e-3, 0.0)):
        body.move_to(x, v)
        assert body.force == body.load(x, v) == cube.force(x, v)


def test_the_force_holds_still_until_the_lost_motion_is_passed():
    body = slave(LINEAR, 50e-6, 2e-6)
    up = moved(body, np.linspace(0.0, 2e-3, 100))
    body.move_to(2e-3 - 99e-6, -0.01)
    assert body.force == pytest.approx(up[-1], rel=1e-6)
    body.move_to(2e-3 - 150e-6, -0.01)
    assert body.force == pytest.approx(up[-1] - 50e-6 * 5000.0 / 1.01, rel=1e-6)


def test_friction_is_the_lost_motion_over_the_compliance():
    body = slave(LINEAR, 40e-6, 4e-6)
    body.move_to(2e-3, 1e-9)
    assert body.load(2e-3, 1e-9) - body.force == pytest.approx(10.0)


@pytest.mark.parametrize("frequency", [0.5, 2.0, 8.0])
def test_the_force_does_not_chatter_at_one_kilohertz(frequency):
    """Between its turning points the force of a driven sine only rises or only falls."""
    x, f, load = driven(Cube(15e3, 5e9, 20.0), Transmission(50e-6, 4e-6), 1.5e-3, frequency)
    for signal in (x, f, load):
        signs = np.sign(np.diff(signal))
        turns = np.count_nonzero(np.diff(signs[signs != 0]))
        assert turns <= 7


def test_a_slave_at_rest_keeps_its_force():
    plant = Plant(LINEAR, PlantParameters(transmission=Transmission(50e-6, 4e-6)))
    for _ in range(500):
        plant.advance(TICK, Command(0.0, 4e-3))
    for _ in range(500):
        plant.advance(TICK, Command(0.0, 0.0))
    force = plant.slave.force
    for _ in range(500):
        plant.advance(TICK, Command(0.0, 0.0))
        assert plant.slave.force == pytest.approx(force, abs=1e-6)


@given(st.floats(0.0, 1e10), st.floats(0.0, 1e-4), st.floats(-0.02, 0.02))
def test_cube_and_spring_share_the_displacement(k3, compliance, x):
    cube = Cube(5000.0, k3, 5.0)
    y = cube.compressed(x, compliance)
    assert y + compliance * cube.force(y, 0.0) == pytest.approx(x, rel=1e-9, abs=1e-15)


def test_a_sensor_at_the_tip_reads_where_the_cube_is_compressed_to():
    cube = Cube(15e3, 5e9, 20.0)
    setup = Setup(cube, 1e-3, 1e-3, Transmission(50e-6, 4e-6))
    x, force, _ = driven(cube, setup.transmission, 1e-3, 0.05, periods=1)
    tip = setup.tip(x)
    np.testing.assert_allclose([cube.force(y, 0.0) for y in tip], force, atol=0.02)


def test_a_cube_that_lets_go_does_not_stretch_the_transmission():
    loose = Cube(5000.0, 1e8, 5.0, glued=False)
    assert loose.compressed(-1e-3, 1e-5) == -1e-3
    assert loose.stiffness(-1e-3) == 0.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((-1e-6, 1e-6), "lost_motion must be >= 0"),
        ((1e-6, math.inf), "compliance must be >= 0"),
        ((1e-6, 0.0), "needs a compliance"),
    ],
)
def test_an_impossible_transmission_is_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Transmission(*values)
