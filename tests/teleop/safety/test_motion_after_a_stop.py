"""Motion after a stop: a drive that moves on is reported, a slave without power is not."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest

from drivers import STANDSTILL, Ages, Measurement
from teleop.safety import Fault, Limits, Mode, Request, Supervision, supervise
from teleop.safety.channels import DetectedFault
from teleop.safety.checks import LONGEST_HALT, REST

DT = 1e-3
KEY = DetectedFault(Fault.EMERGENCY_STOP, "key", math.nan, math.nan, math.nan)
SOFT_FORCE = 20.0
LIMITS = Limits(
    max_velocity=0.2, soft_force=SOFT_FORCE, hard_force=1e3, hard_position=(-10.0, 10.0)
)
FRESH = Ages(0.0, 0.0, 0.0, 0.0, 0.0)


class Slave:
    """The slave at the stop, without power: m x'' = -f(x) - friction."""

    def __init__(self, x, v, stiffness=0.0, coulomb=0.0, viscous=0.0, mass=3.0):
        self.x, self.v = x, v
        self.stiffness, self.coulomb, self.viscous, self.mass = stiffness, coulomb, viscous, mass

    @property
    def force(self):
        return self.stiffness * max(self.x, 0.0)

    def step(self):
        for _ in range(10):
            h = 0.1 * DT
            self.v -= h * (self.force + self.viscous * self.v) / self.mass
            self.v -= math.copysign(min(abs(self.v), h * self.coulomb / self.mass), self.v)
            self.x += self.v * h


class Driven(Slave):
    """The slave whose drive continues with the velocity at the stop."""

    def step(self):
        self.x += self.v * DT


def reports(slave, seconds=3.0, *, halt=False, limits=LIMITS, **changes):
    """Return the time of the report of motion after the stop [s]; NaN if there is none."""
    state = Supervision(mode=Mode.ACTIVE, since=-1.0, time=-DT, position=slave.x)
    for n in range(round(seconds / DT)):
        now = n * DT
        measurement = Measurement(now, 1e-3 * (-1) ** n, 0.0, slave.x, slave.force, slave.v, FRESH)
        measurement = measurement._replace(**{k: f(now, slave) for k, f in changes.items()})
        stop = Request(halt=True, stop="Ctrl-C") if halt else Request(faults=(KEY,))
        request = stop if n == 0 else Request(stop="Ctrl-C")
        verdict = supervise(state, measurement, STANDSTILL, request, limits)
        state = verdict.state
        for event in verdict.events:
            if event.fault is Fault.MOVES_AFTER_STOP:
                assert "use the hardware emergency stop" in event.text
                assert LIMITS.following_error < abs(event.value)
                return now
        slave.step()
    return math.nan


class Oscillating(Slave):
    """The slave whose drive oscillates about a position in the specimen."""

    def __init__(self, frequency, amplitude=10e-3):
        super().__init__(15e-3, 0.0, 400.0)
        self.w, self.amplitude, self.now = math.tau * frequency, amplitude, 0.0

    def step(self):
        self.now += DT
        self.x = 15e-3 + self.amplitude * math.sin(self.w * self.now)


@pytest.mark.parametrize("frequency", [1.5, 2.0, 5.0, 10.0])
def test_a_drive_that_oscillates_in_the_specimen_after_a_stop_is_reported(frequency):
    assert reports(Oscillating(frequency)) < LONGEST_HALT + 1.0 / frequency


@pytest.mark.parametrize("force", [-5.0, -math.inf])
def test_a_constant_contact_force_does_not_explain_motion(force):
    noise = random.Random(1)
    found = reports(
        Driven(0.0, 0.05), contact_force=lambda now, slave: force + noise.gauss(0.0, 0.05)
    )
    assert found < LONGEST_HALT + 0.2


@pytest.mark.parametrize("velocity", [0.007, -0.007, 0.2, -0.2])
@pytest.mark.parametrize("stiffness", [0.0, 400.0])
def test_a_drive_that_moves_on_after_a_stop_is_reported(velocity, stiffness):
    start = -0.1 if stiffness and velocity < 0.0 else 0.0
    found = reports(Driven(start, velocity, stiffness))
    assert LONGEST_HALT < found < LONGEST_HALT + 0.05


def test_a_drive_that_moves_on_after_a_second_ctrl_c_is_reported():
    assert reports(Driven(0.0, 0.05), halt=True) < LONGEST_HALT + 0.05


def test_motion_after_a_stop_is_the_most_severe_fault():
    assert next(iter(Fault)) is Fault.MOVES_AFTER_STOP


@pytest.mark.parametrize(
    "slave",
    [
        Slave(0.0, 0.2, coulomb=1.25),
        Slave(0.0, -0.2, coulomb=3.0),
        Slave(0.0, 0.2, stiffness=2000.0, coulomb=2.0),
        Slave(6.5e-3, 0.0, stiffness=2000.0, coulomb=2.0),
        Slave(15e-3, 0.1, stiffness=400.0, viscous=50.0),
        Slave(15e-3, 0.0, stiffness=400.0, viscous=400.0),
        Slave(15e-3, 0.0, stiffness=2000.0, viscous=2000.0),
        Slave(15e-3, 0.0, stiffness=400.0, viscous=4000.0),
    ],
    ids=[
        "coasts into free space",
        "coasts out of the specimen",
        "is stopped by the specimen",
        "is pushed out of the specimen",
        "is pushed out with little damping",
        "is pushed out slowly",
        "is pushed out of a hard specimen slowly",
        "is pushed out for ten seconds",
    ],
)
def test_a_slave_without_power_is_not_reported(slave):
    before = slave.x, slave.v
    assert math.isnan(reports(slave, 12.0))
    assert (slave.x, slave.v) != before


@pytest.mark.parametrize("slave", [Slave(6.5e-3, 0.0, 2000.0, 2.0), Slave(0.0, 0.05, viscous=10.0)])
def test_while_the_drives_are_disabled_the_slave_need_not_follow_a_command(slave):
    state = Supervision(mode=Mode.ACTIVE, since=-1.0, time=-DT, position=slave.x)
    start = slave.x
    for n in range(400):
        noise = 1e-3 * (-1) ** n
        measurement = Measurement(n * DT, noise, 0.0, slave.x, slave.force + noise, slave.v, FRESH)
        request = Request(halt=n == 0, stop="Ctrl-C")
        state = supervise(state, measurement, STANDSTILL, request, LIMITS).state
        slave.step()
    assert abs(slave.x - start) > LIMITS.following_error
    assert state.mode is Mode.IDLE


def test_a_slave_that_a_person_moves_after_it_came_to_rest_is_not_reported():
    hand = Driven(0.0, 0.0)

    def position(now, slave):
        return 0.05 * max(now - 1.2 * REST, 0.0)

    assert math.isnan(reports(hand, slave_position=position))


def test_noise_of_the_position_is_not_reported():
    limits = replace(LIMITS, rest_velocity=1e-4)

    def position(now, slave):
        return 1e-3 * (-1) ** round(now / DT)

    slave = Driven(0.0, 0.0)
    assert math.isnan(reports(slave, limits=limits, slave_position=position))


def test_a_position_that_is_unknown_at_the_stop_is_checked_as_soon_as_it_is_known():
    def lost(now, slave):
        return math.nan if now < 0.1 else slave.x

    assert reports(Driven(0.0, 0.05), slave_position=lost) == pytest.approx(0.1, abs=0.52)


def test_a_stale_position_is_not_taken_for_rest():
    def age(now, slave):
        return FRESH._replace(slave_position=0.05 if now < 0.3 else 0.0)

    assert reports(Driven(0.0, 0.05), age=age) < 1.0
