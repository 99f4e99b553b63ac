"""Rigs with drives that accept forces or positions: trials, checks, and faults of the wire."""

from __future__ import annotations

import contextlib
import math

import pytest

from drivers import NotStoppedError
from sim_backend.wire.emulator import PlannedFault
from teleop.control.clock import VirtualClock
from teleop.rig.drive_check import STROKE_TIMES, STROKES, check_drives
from teleop.safety import Fault

FORCE_MASTERS = {
    "mit-motor": ("can", "master"),
    "epos4-master": ("drives", "master_drive"),
    "odrive-torque": ("can", "master"),
    "hapkit": ("handle", "paddle"),
    "dynamixel": ("servos", "servo"),
}
"""Rigs whose master accepts forces or closes a coupling itself, with its bus and its device."""
AT = 0.3
"""Time of a fault after the drives were enabled [s]."""


def checked(trial, move=True):
    """Return the report of the check of the drives, and the names of the drives in operation."""
    clock = VirtualClock(trial.settings.loop_rate)
    with contextlib.suppress(NotStoppedError), trial.make_rig(clock.now) as rig:
        report = check_drives(rig, clock, move)
        for _ in range(30):
            clock.wait()
            rig.read()
        driven = set(rig.emulator.mechanism.driven)
    return report, driven


@pytest.fixture
def quick_strokes(monkeypatch):
    """Makes the first stroke as quick as the others."""
    monkeypatch.setattr("teleop.rig.drive_check.STROKE_TIMES", STROKE_TIMES[1:2] * len(STROKES))


@pytest.mark.parametrize("name", FORCE_MASTERS)
def test_a_hand_moves_the_slave_through_the_coupling(in_memory, name):
    trial = in_memory(name, "free", duration=2.0).run()
    assert trial.fault is None
    assert trial.rejected == {}


@pytest.mark.usefixtures("quick_strokes")
@pytest.mark.parametrize("name", FORCE_MASTERS)
def test_a_free_handle_follows_the_strokes_and_its_watchdog_acts(in_memory, name):
    report, driven = checked(in_memory(name))
    assert report.fault is None
    assert {drive.name: drive.problem for drive in report.drives} == {"master": "", "slave": ""}
    master = report.drives[0]
    assert master.commanded_m == pytest.approx(STROKES[-1], rel=0.05)
    # The paddle oscillates on its coupling, because it has little damping.
    assert master.ratio == pytest.approx(1.0, abs=1.0 if name == "hapkit" else 0.1)
    assert 0.01 < master.watchdog_s < 0.15
    assert not driven


@pytest.mark.usefixtures("quick_strokes")
def test_a_watchdog_that_is_not_reported_is_not_tested(in_memory):
    report, driven = checked(in_memory("haply"))
    assert report.fault is None
    assert {drive.name: drive.problem for drive in report.drives} == {"master": "", "slave": ""}
    watchdogs = {drive.name: drive.watchdog_s for drive in report.drives}
    assert math.isnan(watchdogs["master"])
    assert 0.01 < watchdogs["slave"] < 0.15
    assert not driven


@pytest.mark.parametrize("name", ["mit-motor", "hapkit"])
def test_over_pseudo_terminals_a_trial_runs(stepped, name):
    trial = stepped(name, "autonomous", duration=0.5).run()
    assert trial.fault is None


@pytest.mark.parametrize("name", FORCE_MASTERS)
@pytest.mark.parametrize(("kind", "fault"), [("silence", Fault.STALE), ("drop", None)])
def test_a_silent_wire_is_a_stop_and_lost_frames_are_not(in_memory, name, kind, fault):
    bus, _ = FORCE_MASTERS[name]
    emulators = []
    faults = [PlannedFault(kind, bus, AT)]
    trial = in_memory(name, duration=0.6, faults=faults, prepare=emulators.append).run()
    assert (trial.fault and trial.fault["fault"]) == fault
    assert not emulators[0].mechanism.driven


@pytest.mark.parametrize("name", FORCE_MASTERS)
def test_a_reset_of_the_master_is_a_stop(in_memory, name):
    _, device = FORCE_MASTERS[name]
    emulators = []
    faults = [PlannedFault("reset", device, AT)]
    trial = in_memory(name, duration=0.6, faults=faults, prepare=emulators.append).run()
    assert trial.fault["fault"] in (Fault.DRIVE_ERROR, Fault.STALE)
    assert not emulators[0].mechanism.driven


@pytest.mark.usefixtures("quick_strokes")
@pytest.mark.parametrize("name", ["hapkit", "odrive-torque"])
def test_a_motor_that_pushes_in_the_wrong_direction_is_refused(in_memory, name):
    def prepare(emulator):
        push = emulator.mechanism.push
        emulator.mechanism.push = lambda axis, force: push(
            axis, -force if axis == "master" else force
        )

    report, driven = checked(in_memory(name, prepare=prepare))
    problem = report.drives[0].problem
    assert report.fault or "check the sign of drives.master" in problem
    assert not driven
