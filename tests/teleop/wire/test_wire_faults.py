"""What becomes of a trial when its wire fails: ridden through, or stopped under its name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from drivers import RigError
from sim_backend.wire.emulator import PlannedFault
from sim_backend.wire.wire_faults import FAULTS, BaudMismatch, Burst
from teleop.safety import Fault, Mode

AT = 0.2
"""When a fault sets in, after the drives were enabled [s]."""


class Wired(NamedTuple):
    """An example rig, and its bus and device whose wire fails."""

    rig: str
    bus: str
    device: str
    reset: Fault
    """What a reset of the device is told as: a CANopen drive boots in silence."""


BOARD = Wired("serial-board", "usb", "board", Fault.DRIVE_ERROR)
ODRIVE = Wired("odrive-bota", "can", "slave", Fault.DRIVE_ERROR)
CIA402 = Wired("cia402-ft300", "drives", "slave_drive", Fault.STALE)
WIRES = [BOARD, ODRIVE, CIA402]
NAMES = [wired.bus for wired in WIRES]


def run(stepped, wired, kind, where="", duration=0.45):
    """A trial whose wire fails at `AT`; the trial and the emulator."""
    emulators = []
    fault = PlannedFault(kind, where or wired.bus, AT)
    trial = stepped(wired.rig, duration=duration, faults=[fault], prepare=emulators.append)
    return trial.run(), emulators[0]


def check_stopped(trial, emulator):
    """The slave is told to stand still from the fault on, and does."""
    recording = trial.recording
    fault = recording["time"] >= trial.fault["time"] + 0.1
    assert fault.any()
    assert not recording["commanded_slave_velocity"][fault].any()
    assert not recording["applied_slave_velocity"][fault].any()
    assert recording["mode"][-1] == Mode.FAULT
    assert not emulator.mechanism.driven


@pytest.mark.parametrize("kind", ["drop", "double", "reorder", "truncate", "length"])
@pytest.mark.parametrize("wired", [BOARD, ODRIVE], ids=["usb", "can"])
def test_frames_that_are_lost_doubled_or_broken_now_and_then_are_ridden_through(
    stepped, wired, kind
):
    trial, _ = run(stepped, wired, kind)
    assert trial.fault is None
    assert trial.recording["time"][-1] == pytest.approx(0.45, abs=0.1)
    assert np.isfinite(trial.summary()["estimates"]["rls"]["k"])


@pytest.mark.parametrize("kind", ["corrupt", "noise"])
def test_noise_on_a_line_with_check_sums_costs_the_frames_that_it_hits(stepped, kind):
    trial, _ = run(stepped, BOARD, kind)
    assert trial.fault is None
    late = trial.recording["time"] > AT + 0.1
    ages = trial.recording["contact_force_age"][late]
    assert ages.max() < 0.02


@pytest.mark.parametrize("kind", ["corrupt", "noise"])
@pytest.mark.parametrize("wired", [ODRIVE, CIA402], ids=["can", "drives"])
def test_noise_on_an_slcan_line_which_has_none_is_ridden_through_or_stops_the_rig(
    stepped, wired, kind
):
    trial, emulator = run(stepped, wired, kind)
    if trial.fault:
        assert trial.fault["time"] > AT
        check_stopped(trial, emulator)


@pytest.mark.parametrize("kind", ["delay", "silence", "baud"])
@pytest.mark.parametrize("wired", WIRES, ids=NAMES)
def test_a_wire_that_brings_nothing_fresh_is_told_as_stale(stepped, wired, kind):
    trial, emulator = run(stepped, wired, kind)
    assert trial.fault["fault"] == Fault.STALE
    assert AT < trial.fault["time"] < AT + 0.1
    check_stopped(trial, emulator)


@pytest.mark.parametrize("wired", [BOARD, ODRIVE], ids=["usb", "can"])
def test_bursts_within_the_age_limit_are_ridden_through(stepped, wired):
    trial, _ = run(stepped, wired, "burst")
    assert trial.fault is None


@pytest.mark.parametrize("wired", [BOARD, ODRIVE], ids=["usb", "can"])
def test_bursts_beyond_the_age_limit_are_stale(stepped, wired, monkeypatch):
    monkeypatch.setitem(FAULTS, "burst", lambda: Burst(0.1))
    trial, emulator = run(stepped, wired, "burst")
    assert trial.fault["fault"] == Fault.STALE
    check_stopped(trial, emulator)


@pytest.mark.parametrize("wired", WIRES, ids=NAMES)
def test_a_port_that_is_unplugged_stops_the_rig_and_plugged_in_again_starts_nothing(stepped, wired):
    emulators = []
    faults = [PlannedFault("unplug", wired.bus, AT), PlannedFault("replug", wired.bus, AT + 0.1)]
    trial = stepped(wired.rig, duration=0.45, faults=faults, prepare=emulators.append).run()
    assert trial.fault["fault"] == Fault.RIG_FAILURE
    assert "is disconnected" in trial.fault["text"]
    check_stopped(trial, emulators[0])


@pytest.mark.parametrize("wired", WIRES, ids=NAMES)
def test_a_device_that_was_reset_stops_the_rig(stepped, wired):
    trial, emulator = run(stepped, wired, "reset", wired.device)
    assert trial.fault["fault"] == wired.reset
    if wired.reset is Fault.DRIVE_ERROR:
        assert wired.device in trial.fault["text"]
    check_stopped(trial, emulator)


@pytest.mark.parametrize("wired", WIRES, ids=NAMES)
def test_a_line_at_another_baud_rate_is_told_at_the_start(stepped, wired, monkeypatch):
    monkeypatch.setattr("drivers.devices.board.PATIENCE", 0.5)

    def mismatch(emulator):
        emulator.wires[wired.bus].fault = BaudMismatch()

    with pytest.raises(RigError, match="baud|is not acknowledged"):
        stepped(wired.rig, prepare=mismatch).run()


@pytest.mark.parametrize("wired", [ODRIVE, CIA402], ids=["can", "drives"])
def test_a_bus_that_is_off_is_told_as_that(stepped, wired):
    trial, emulator = run(stepped, wired, "bus-off")
    assert trial.fault["fault"] == Fault.RIG_FAILURE
    assert "is off" in trial.fault["text"]
    check_stopped(trial, emulator)


def test_error_frames_are_counted_while_the_others_come(stepped):
    trial, _ = run(stepped, ODRIVE, "error-frames")
    assert trial.fault is None


def test_a_board_of_another_version_is_refused_at_the_start(stepped):
    def newer(emulator):
        emulator.devices["board"].version = 2

    with pytest.raises(RigError, match="version 2 of the protocol, expected 1"):
        stepped("serial-board", prepare=newer).run()
