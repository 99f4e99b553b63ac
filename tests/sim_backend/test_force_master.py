"""A simulated force-commanded master against an integrator, and in trials."""

from __future__ import annotations

import math

import pytest
from scipy.integrate import solve_ivp

from sim_backend import Arm, ForceMaster, Intention
from sim_backend.force_master import FreeHandle, SimulatedMotor, parse_values

PERIOD = 1e-3


def test_a_handle_moves_as_an_ode_solver_computes():
    arm, mass, friction = Arm(1500.0, 25.0), 0.1, 2.0
    handle = FreeHandle(mass, friction)
    state = [0.0, 0.0]
    for k in range(300):
        push = math.sin(0.05 * k)
        end = Intention(1e-3 * math.sin(0.1 * (k + 1)), 0.1 * math.cos(0.1 * (k + 1)))
        handle.push = push
        handle.advance(0.0, PERIOD, arm, end)

        def motion(t, y, push=push, end=end):
            wanted = end.position - end.velocity * (PERIOD - t)
            hand = arm.stiffness * (wanted - y[0]) + arm.damping * (end.velocity - y[1])
            return [y[1], (hand + push - friction * y[1]) / mass]

        state = solve_ivp(motion, (0.0, PERIOD), state, rtol=1e-9, atol=1e-12).y[:, -1]
        assert handle.x == pytest.approx(state[0], abs=2e-6)


def test_a_handle_that_nobody_holds_coasts_to_rest_by_friction():
    handle = FreeHandle(0.2, 2.0)
    handle.v = 0.1
    for _ in range(3000):
        handle.advance(0.0, PERIOD, Arm(1e6, 1e3), None)
    assert handle.x == pytest.approx(0.2 * 0.1 / 2.0, rel=1e-3)


def test_the_motor_acts_after_its_latency_and_stops_at_once():
    handle = FreeHandle(0.2, 2.0)
    motor = SimulatedMotor(handle, 2)
    acting = []
    for force in (1.0, 2.0, 3.0, 4.0):
        motor.command(force)
        acting.append(handle.push)
    assert acting == [0.0, 0.0, 1.0, 2.0]
    assert motor.idle()
    assert handle.push == 0.0
    motor.command(0.0)
    assert handle.push == 0.0


def test_a_text_gives_a_master_and_wrong_texts_are_refused_with_the_names():
    assert parse_values("force master", ForceMaster, "default") == ForceMaster()
    found = parse_values("force master", ForceMaster, "stiffness=500, latency=2")
    assert (found.stiffness, found.latency) == (500.0, 2)
    for text in ("stiffness", "stiff=1", "latency=1.5", "stiffness=1,stiffness=2", ""):
        with pytest.raises(ValueError, match="max_force"):
            parse_values("force master", ForceMaster, text)
    with pytest.raises(ValueError, match="mass"):
        parse_values("force master", ForceMaster, "mass=0")
