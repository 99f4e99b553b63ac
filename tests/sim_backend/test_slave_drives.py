"""A simulated slave follows commanded velocities whatever its drive accepts."""

from __future__ import annotations

import math

import pytest

from drivers import Command
from sim_backend import CUBES, ForceMaster, ForceSlave, SimulatedRig
from sim_backend.plant import PlantParameters
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

PERIOD = 1e-3


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def palpated(kind, body="soft", amplitude=5e-3, seconds=1.0):
    """Run a sine into a body; return the largest deviation from the commanded travel [m]."""
    clock = Clock()
    rig = SimulatedRig(CUBES[body], clock, slave_drive=kind, period=PERIOD)
    worst = travel = 0.0
    with rig:
        rig.read()
        assert rig.enable()
        for k in range(round(seconds / PERIOD)):
            velocity = 0.5 * amplitude * 4.0 * math.pi * math.sin(4.0 * math.pi * k * PERIOD)
            rig.write(Command(0.0, velocity))
            travel += velocity * PERIOD
            clock.now = (k + 1) * PERIOD
            measurement = rig.read()
            assert measurement.drive_error == ""
            worst = max(worst, abs(measurement.slave_position - travel))
        assert rig.idle()
        assert rig.plant.slave.push is None
    return worst


@pytest.mark.parametrize("kind", ["velocity", ForceSlave(), "position"])
def test_the_slave_follows_in_contact(kind):
    lag = {"velocity": 2e-3, "position": 12e-3}.get(kind, 6e-3)
    fastest = 0.5 * 5e-3 * 4.0 * math.pi
    assert palpated(kind) < 1.3 * lag * fastest


def test_a_force_driven_slave_comes_to_rest_in_the_hard_cube():
    clock = Clock()
    rig = SimulatedRig(CUBES["hard"], clock, slave_drive=ForceSlave(), period=PERIOD)
    rig.open()
    rig.read()
    rig.enable()
    positions = []
    for k in range(1, 700):
        rig.write(Command(0.0, 0.01 if k < 100 else 0.0))
        clock.now = k * PERIOD
        positions.append(rig.read().slave_position)
    assert rig.plant.contact_force.y > 10.0
    assert max(positions[-100:]) - min(positions[-100:]) < 3e-6


@pytest.mark.parametrize(("mass", "oscillates"), [(1.0, False), (6.0, False), (12.0, True)])
def test_a_velocity_loop_for_a_wrong_mass_is_an_error_if_it_oscillates(mass, oscillates):
    slave, clock = ForceSlave(mass=mass), Clock()
    assert bool(slave.problem(3.0, PERIOD)) is oscillates
    rig = SimulatedRig(CUBES["soft"], clock, slave_drive=slave, period=PERIOD)
    rig.open()
    rig.read()
    rig.enable()
    for k in range(1, 500):
        rig.write(Command(0.0, 0.03 if k < 200 else 0.0))
        clock.now = k * PERIOD
        error = rig.read().drive_error
    assert ("the velocity loop oscillates" in error) is oscillates


def test_a_force_slave_at_a_slow_loop_runs_a_trial_in_the_soft_cube():
    settings = TrialSettings(
        clock="virtual", duration=5.0, rate=250.0, force_slave=ForceSlave(), estimators=("rls",)
    )
    assert run_trial(settings).fault is None


def test_a_motor_out_of_operation_exerts_no_force_and_the_slave_brakes():
    clock = Clock()
    rig = SimulatedRig(CUBES["soft"], clock, slave_drive=ForceSlave(), parameters=PlantParameters())
    rig.open()
    rig.read()
    rig.write(Command(0.0, 0.1))
    assert rig.plant.slave.push is None
    rig.enable()
    for k in range(1, 100):
        rig.write(Command(0.0, 0.05))
        clock.now = k * PERIOD
        rig.read()
    assert rig.plant.slave.v == pytest.approx(0.05, rel=0.1)
    rig.idle()
    for k in range(100, 200):
        clock.now = k * PERIOD
        rig.read()
    assert rig.plant.slave.push is None
    assert abs(rig.plant.slave.v) < 1e-3


def test_the_error_of_a_coupling_remains_until_a_person_arms_again():
    clock = Clock()
    rig = SimulatedRig(CUBES["soft"], clock, master=ForceMaster(stiffness=500.0), period=PERIOD)
    rig.open()
    rig.read()
    assert rig.enable()
    rig.plant.handle.v = 3.0
    for k in range(1, 60):
        rig.write(Command(0.0, 0.0))
        clock.now = k * PERIOD
        rig.read()
    assert "drive master: " in rig.read().drive_error
    rig.idle()
    for k in range(60, 2000):
        clock.now = k * PERIOD
        rig.read()
    assert "drive master: " in rig.read().drive_error
    rig.rearm()
    clock.now += PERIOD
    assert rig.read().drive_error == ""
    assert rig.enable()
