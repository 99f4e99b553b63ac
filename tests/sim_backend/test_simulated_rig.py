from __future__ import annotations

import math

import numpy as np
import pytest

from drivers import STANDSTILL, Command
from sim_backend import CUBES, FreePalpation, Sensors, SimulatedRig


class HandClock:
    time = 0.0

    def __call__(self):
        return self.time


def palpate(seed, ticks=300):
    clock = HandClock()
    out = []
    with SimulatedRig(CUBES["soft"], clock, FreePalpation(9e-3, seed), seed=seed) as rig:
        for i in range(ticks):
            clock.time = i * 1e-3
            out.append(rig.read())
            rig.write(Command(0.01, 0.01))
    return out


def test_same_seed_same_measurements_to_the_bit():
    assert palpate(1) == palpate(1)
    assert palpate(1) != palpate(2)


def test_positions_are_whole_encoder_counts():
    counts = np.array([m.slave_position for m in palpate(0)]) / 1e-6
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert counts.max() > 2000


def test_force_at_rest_is_noise_of_the_stated_size():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock, sensors=Sensors(force_noise=0.05))
    rig.open()
    force = [rig.read().contact_force for _ in range(4000)]
    assert np.mean(force) == pytest.approx(0.0, abs=0.005)
    assert np.std(force) == pytest.approx(0.05, rel=0.1)


def test_every_channel_is_fresh():
    assert palpate(0)[-1].age == (0.0,) * 5


def test_applies_what_the_drives_can_do_and_says_so():
    rig = SimulatedRig(CUBES["soft"], HandClock(), max_velocity=0.1)
    rig.open()
    assert rig.write(Command(-1.0, 0.05)) == Command(-0.1, 0.05)


def test_after_a_stop_the_slave_comes_to_rest():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock)
    rig.open()
    rig.write(Command(0.0, 0.05))
    clock.time = 0.04
    assert rig.read().slave_velocity > 0.01
    rig.stop()
    clock.time = 1.0
    assert abs(rig.read().slave_velocity) < 1e-6
    assert rig.write(STANDSTILL) == STANDSTILL


def test_drives_that_are_not_commanded_any_more_stop_by_themselves():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock, watchdog=0.05)
    rig.open()
    rig.write(Command(0.02, 0.02))
    clock.time = 2.0
    stalled = rig.read()
    assert stalled.slave_position < 0.02 * 0.06
    assert abs(stalled.slave_velocity) < 1e-6


def test_reading_twice_at_one_time_moves_nothing():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock)
    rig.open()
    rig.write(Command(0.0, 0.05))
    clock.time = 0.05
    assert rig.read().slave_position == rig.read().slave_position


@pytest.mark.parametrize("values", [(0.0, 0.02), (1e-6, -0.1), (math.nan, 0.0)])
def test_impossible_sensors_are_refused(values):
    with pytest.raises(ValueError, match="must be"):
        Sensors(*values)
