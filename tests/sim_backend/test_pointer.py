"""The hand that follows a pointer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lsim

from drivers import Command
from sim_backend import CUBES, PointerOperator, SimulatedRig
from sim_backend.pointer import BANDWIDTH, MOST_SPEED


class Script:
    """A pointer whose state a test sets."""

    def __init__(self):
        self.depth, self.grip = 0.0, False

    def __call__(self):
        return self.depth, self.grip


def limited(t, u):
    """Return the positions of a pointer at the times t, followed at most with `MOST_SPEED`."""
    found, position, before = [], 0.0, 0.0
    for now, wanted in zip(t, u, strict=True):
        position += np.clip(
            wanted - position, -MOST_SPEED * (now - before), MOST_SPEED * (now - before)
        )
        found.append(position)
        before = now
    return np.array(found)


def test_the_motion_is_that_of_a_critically_damped_filter_of_the_limited_position():
    script = Script()
    operator = PointerOperator(script)
    script.grip = True
    operator.intention(0.0)
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.2e-3, 3e-3, 300))
    u = np.repeat(rng.uniform(0.0, 0.01, 30), 10)
    followed = limited(t, u)
    w = 2.0 * math.pi * BANDWIDTH
    system = ([w**2], [1.0, 2.0 * w, w**2])
    found, last = [], 0.0
    for now, depth in zip(t, u, strict=True):
        script.depth = depth
        found.append(operator.intention(now).position)
        last = now
    fine = np.arange(0.0, last, 1e-5)
    held = followed[np.minimum(np.searchsorted(t, fine), len(u) - 1)]
    _, expected, _ = lsim(system, held, fine)
    assert found == pytest.approx(np.interp(t, fine, expected), abs=2e-6)


def test_a_pointer_that_jumps_moves_the_hand_with_a_limited_speed(held):
    rig, script, step = held
    operator = script.operator
    script.depth, script.grip = rig.plant.handle.x, True
    step(2)
    start, script.depth = operator.depth, 1.0
    wanted = []
    for _ in range(100):
        step(1)
        wanted.append(operator.depth)
    assert np.diff([start, *wanted]) == pytest.approx(MOST_SPEED * 1e-3)
    script.depth = -1.0
    step(1)
    assert operator.depth == pytest.approx(wanted[-1] - MOST_SPEED * 1e-3)


@pytest.mark.parametrize("last", [0.01, 20.0])
def test_a_hand_that_holds_on_while_the_drives_are_enabled_again_takes_hold_anew(last):
    script = Script()
    operator = PointerOperator(script)
    script.depth, script.grip = 5e-3, True
    for now in (0.0, last):
        assert operator.intention(now)
    anew = operator.intention(0.0)
    assert (anew.position, anew.velocity) == (0.0, 0.0)  # no handle is known in this test


@pytest.fixture
def held():
    """A rig in operation whose handle is at 5 mm, its pointer, and a function for a step."""
    script = Script()
    now = [0.0]
    script.operator = PointerOperator(script)
    rig = SimulatedRig(CUBES["soft"], lambda: now[0], operator=script.operator)
    rig.open()
    rig.enable()

    def step(count, velocity=0.0):
        for _ in range(count):
            rig.write(Command(velocity, 0.0))
            now[0] += 1e-3
            measured = rig.read()
        return measured

    step(500, 0.01)
    return rig, script, step


def test_the_force_begins_at_zero_when_the_hand_takes_hold_anywhere(held):
    rig, script, step = held
    script.depth, script.grip = 0.02, True
    forces = [step(1).master_force for _ in range(200)]
    assert abs(forces[0]) < 0.2
    assert np.abs(np.diff(forces)).max() < 0.8  # w^2 times distance and damping; unfiltered 6 N
    assert forces[-1] == pytest.approx(400.0 * (0.02 - rig.plant.handle.x), rel=0.1)


def test_no_force_acts_when_the_hand_has_let_go(held):
    _, script, step = held
    script.depth, script.grip = 0.02, True
    assert step(100).master_force > 4.0
    script.grip = False
    assert abs(step(20).master_force) < 0.1
