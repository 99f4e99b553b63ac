from __future__ import annotations

import math

import pytest

from drivers import STANDSTILL, Command, RigError
from sim_backend import CUBES, FaultyRig, SimulatedRig
from sim_backend.faults import Frozen, Replaced, Reported, Runaway, Shifted, Unplugged


class HandClock:
    time = 0.0

    def __call__(self):
        return self.time


@pytest.fixture
def rig():
    clock = HandClock()
    rig = FaultyRig(SimulatedRig(CUBES["soft"], clock))
    rig.clock = clock
    rig.open()
    return rig


def reads(rig, count, command=STANDSTILL):
    out = []
    for _ in range(count):
        rig.clock.time += 1e-3
        out.append(rig.read())
        rig.write(command)
    return out


def test_without_a_fault_it_behaves_as_the_rig(rig):
    plain = SimulatedRig(CUBES["soft"], rig.clock)
    plain.open()
    rig.enable()
    plain.enable()
    for _ in range(50):
        rig.clock.time += 1e-3
        assert rig.read() == plain.read()
        assert rig.write(Command(0.01, 0.02)) == plain.write(Command(0.01, 0.02))


def test_a_replaced_and_a_shifted_channel_do_not_change_other_channels(rig):
    rig.inject(Replaced("contact_force", math.inf))
    before = reads(rig, 1)[0]
    assert before.contact_force == math.inf
    assert abs(before.master_force) < 0.2
    rig.inject(Shifted("slave_position", 0.1, rate=2.0))
    shifted = [m.slave_position for m in reads(rig, 3)]
    assert shifted == pytest.approx([0.1, 0.102, 0.104])


def test_a_frozen_channel_repeats_and_ages_only_if_requested(rig):
    for ageing, ages in ((False, [0.0] * 4), (True, [0.0, 1e-3, 2e-3, 3e-3])):
        rig.inject(Frozen("contact_force", ageing))
        got = reads(rig, 4)
        assert len({m.contact_force for m in got}) == 1
        assert len({m.master_force for m in got}) == 4
        assert [m.age.contact_force for m in got] == pytest.approx(ages)
        assert {m.age.master_force for m in got} == {0.0}


def test_a_runaway_drive_moves_by_itself_until_it_is_idled(rig):
    rig.enable()
    rig.inject(Runaway(0.05))
    assert reads(rig, 100)[-1].slave_position > 3e-3
    assert rig.write(STANDSTILL) == STANDSTILL
    rig.idle()
    stopped = reads(rig, 100)[-1]
    assert abs(stopped.slave_velocity) < 1e-6


def test_reports_and_an_unplugged_board(rig):
    rig.inject(Reported("overcurrent", emergency_stop=True))
    got = reads(rig, 1)[0]
    assert (got.drive_error, got.emergency_stop) == ("overcurrent", True)
    rig.inject(Unplugged())
    with pytest.raises(RigError, match="expected a frame"):
        rig.read()
