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
        rig.enable()
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


def test_returns_the_command_as_limited_by_the_drives():
    rig = SimulatedRig(CUBES["soft"], HandClock(), max_velocity=0.1)
    rig.open()
    rig.enable()
    assert rig.write(Command(-1.0, 0.05)) == Command(-0.1, 0.05)


def test_after_idling_the_slave_comes_to_rest():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock)
    rig.open()
    rig.enable()
    rig.write(Command(0.0, 0.05))
    clock.time = 0.04
    assert rig.read().slave_velocity > 0.01
    rig.idle()
    clock.time = 1.0
    assert abs(rig.read().slave_velocity) < 1e-6
    assert rig.write(STANDSTILL) == STANDSTILL


def test_drives_stop_when_commands_end():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock, watchdog=0.05)
    rig.open()
    rig.enable()
    rig.write(Command(0.02, 0.02))
    clock.time = 2.0
    stalled = rig.read()
    assert stalled.slave_position < 0.02 * 0.06
    assert abs(stalled.slave_velocity) < 1e-6


def test_the_drives_own_watchdog_stays_tripped_until_they_are_enabled_again():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock, watchdog=0.05)
    rig.open()
    rig.enable()
    rig.write(Command(0.0, 0.02))
    clock.time = 0.06
    assert rig.read().drive_error == "watchdog"
    assert rig.write(Command(0.0, 0.02)) == STANDSTILL
    rig.enable()
    assert rig.write(Command(0.0, 0.02)) == Command(0.0, 0.02)
    assert rig.read().drive_error == ""


def test_drives_that_are_not_enabled_do_not_move():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock)
    rig.open()
    assert rig.write(Command(0.1, 0.1)) == STANDSTILL
    clock.time = 0.5
    assert rig.read().slave_position == 0.0


def test_the_operators_time_starts_when_the_drives_are_enabled():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock, FreePalpation(9e-3, 0))
    rig.open()
    for clock.time in (0.5, 1.0):
        assert abs(rig.read().master_force) < 0.2
    rig.enable()
    force = []
    for i in range(500):
        clock.time = 1.0 + i * 1e-3
        force.append(rig.read().master_force)
        rig.write(STANDSTILL)
    assert max(force) > 0.5


def test_the_operator_lets_go_of_the_handle_when_the_drives_are_disabled():
    clock = HandClock()
    rig = SimulatedRig(
        CUBES["soft"], clock, FreePalpation(9e-3, 0), sensors=Sensors(force_noise=0.0)
    )
    rig.open()
    rig.enable()
    for i in range(500):
        clock.time = i * 1e-3
        force = rig.read().master_force
        rig.write(STANDSTILL)
    assert force > 0.5
    rig.idle()
    clock.time += 0.01
    rig.read()
    for _ in range(100):
        clock.time += 1e-2
        assert abs(rig.read().master_force) < 1e-3


def test_sensors_read_from_their_own_zeros():
    clock = HandClock()
    sensors = Sensors(force_noise=0.0, master_zero=1.0, contact_zero=-2.0, contact_position=3e-3)
    rig = SimulatedRig(CUBES["soft"], clock, sensors=sensors)
    rig.open()
    reading = rig.read()
    assert (reading.master_force, reading.contact_force) == (1.0, -2.0)
    assert reading.slave_position == pytest.approx(3e-3)


def test_reading_twice_at_the_same_time_causes_no_motion():
    clock = HandClock()
    rig = SimulatedRig(CUBES["soft"], clock)
    rig.open()
    rig.enable()
    rig.write(Command(0.0, 0.05))
    clock.time = 0.05
    assert rig.read().slave_position == rig.read().slave_position


@pytest.mark.parametrize("values", [(0.0, 0.02), (1e-6, -0.1), (math.nan, 0.0)])
def test_impossible_sensors_are_refused(values):
    with pytest.raises(ValueError, match="must be"):
        Sensors(*values)
