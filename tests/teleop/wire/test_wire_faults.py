"""Faults of a wire during a trial: tolerated, or stopped with the name of the fault."""

from __future__ import annotations

import contextlib
import math
from typing import NamedTuple

import numpy as np
import pytest

from drivers import NotStoppedError, RigError
from sim_backend.wire.emulator import PlannedFault
from sim_backend.wire.wire_faults import FAULTS, BaudMismatch, Burst
from teleop.safety import Fault, Mode, Request
from teleop.safety.channels import DetectedFault
from teleop.trial.assembly import make_clock, make_controller

AT = 0.2
"""Time of a fault after the drives were enabled [s]."""
KEY = DetectedFault(Fault.EMERGENCY_STOP, "key", math.nan, math.nan, math.nan)
RATE = 500.0
"""Rate of the loop [Hz]."""


class Wired(NamedTuple):
    """An example rig, and the bus and device with a faulty wire."""

    rig: str
    bus: str
    device: str
    reset: Fault
    """Faults that may be reported for a reset of the device; a CANopen drive boots silently."""


BOARD = Wired("serial-board", "usb", "board", Fault.DRIVE_ERROR)
ODRIVE = Wired("odrive-bota", "can", "slave", Fault.DRIVE_ERROR)
CIA402 = Wired("cia402-ft300", "drives", "slave_drive", Fault.STALE)
WIRES = [BOARD, ODRIVE, CIA402]
NAMES = [wired.bus for wired in WIRES]


def run(stepped, wired, kind, where="", duration=0.45):
    """Run a trial with a fault of the wire at `AT`; return the trial and the emulator."""
    emulators = []
    fault = PlannedFault(kind, where or wired.bus, AT)
    trial = stepped(
        wired.rig, duration=duration, rate=RATE, faults=[fault], prepare=emulators.append
    )
    return trial.run(), emulators[0]


def check_stopped(trial, emulator):
    """Check that the slave is commanded to stop after the fault, and stops."""
    recording = trial.recording
    fault = recording["time"] >= trial.fault["time"] + 0.1
    assert fault.any()
    assert not recording["commanded_slave_velocity"][fault].any()
    assert not recording["applied_slave_velocity"][fault].any()
    assert recording["mode"][-1] == Mode.FAULT
    assert not emulator.mechanism.driven


@pytest.mark.parametrize(
    ("wired", "kind"),
    [
        *((wired, kind) for kind in ("drop", "gaps", "double", "reorder") for wired in WIRES[:2]),
        (BOARD, "truncate"),
        (BOARD, "length"),
    ],
)
def test_occasional_lost_duplicated_or_corrupt_frames_do_not_stop_the_run(in_memory, wired, kind):
    trial, _ = run(in_memory, wired, kind)
    assert trial.fault is None
    assert trial.recording["time"][-1] == pytest.approx(0.45, abs=0.1)
    assert np.isfinite(trial.summary()["estimates"]["rls"]["k"])


@pytest.mark.parametrize("kind", ["corrupt", "noise"])
def test_noise_on_a_line_with_checksums_loses_only_the_affected_frames(in_memory, kind):
    trial, _ = run(in_memory, BOARD, kind)
    assert trial.fault is None
    late = trial.recording["time"] > AT + 0.1
    ages = trial.recording["contact_force_age"][late]
    assert ages.max() < 0.02


@pytest.mark.parametrize("kind", ["corrupt", "noise", "truncate", "length"])
@pytest.mark.parametrize("wired", [ODRIVE, CIA402], ids=["can", "drives"])
def test_noise_on_an_slcan_line_without_checksums_is_tolerated_or_stops_the_rig(
    in_memory, wired, kind
):
    trial, emulator = run(in_memory, wired, kind)
    if trial.fault:
        assert trial.fault["time"] > AT
        check_stopped(trial, emulator)


@pytest.mark.parametrize("kind", ["delay", "silence", "baud"])
@pytest.mark.parametrize("wired", WIRES, ids=NAMES)
def test_a_wire_without_new_samples_is_reported_as_stale(in_memory, wired, kind):
    trial, emulator = run(in_memory, wired, kind)
    assert trial.fault["fault"] == Fault.STALE
    assert AT < trial.fault["time"] < AT + 0.1
    check_stopped(trial, emulator)


@pytest.mark.parametrize("wired", [BOARD, ODRIVE], ids=["usb", "can"])
def test_bursts_within_the_age_limit_do_not_stop_the_run(in_memory, wired):
    trial, _ = run(in_memory, wired, "burst")
    assert trial.fault is None


@pytest.mark.parametrize("wired", [BOARD, ODRIVE], ids=["usb", "can"])
def test_bursts_beyond_the_age_limit_are_stale(in_memory, wired, monkeypatch):
    monkeypatch.setitem(FAULTS, "burst", lambda: Burst(0.1))
    trial, emulator = run(in_memory, wired, "burst")
    assert trial.fault["fault"] == Fault.STALE
    check_stopped(trial, emulator)


@pytest.mark.parametrize("wired", WIRES, ids=NAMES)
def test_an_unplugged_port_stops_the_rig_and_plugging_it_in_does_not_restart_it(stepped, wired):
    emulators = []
    faults = [PlannedFault("unplug", wired.bus, AT), PlannedFault("replug", wired.bus, AT + 0.1)]
    trial = stepped(wired.rig, duration=0.45, faults=faults, prepare=emulators.append).run()
    assert trial.fault["fault"] == Fault.RIG_FAILURE
    assert "is disconnected" in trial.fault["text"]
    check_stopped(trial, emulators[0])


@pytest.mark.parametrize("wired", WIRES, ids=NAMES)
def test_a_device_that_was_reset_stops_the_rig(in_memory, wired):
    trial, emulator = run(in_memory, wired, "reset", wired.device)
    assert trial.fault["fault"] == wired.reset
    if wired.reset is Fault.DRIVE_ERROR:
        assert wired.device in trial.fault["text"]
    check_stopped(trial, emulator)


@pytest.mark.real_time
@pytest.mark.parametrize("wired", WIRES, ids=NAMES)
def test_a_line_at_another_baud_rate_is_reported_at_the_start(stepped, wired, monkeypatch):
    monkeypatch.setattr("drivers.devices.board.PATIENCE", 0.5)

    def mismatch(emulator):
        emulator.wires[wired.bus].distort(BaudMismatch)

    with pytest.raises(RigError, match="baud|is not acknowledged"):
        stepped(wired.rig, prepare=mismatch).run()


@pytest.mark.parametrize("wired", [ODRIVE, CIA402], ids=["can", "drives"])
def test_bus_off_is_reported(in_memory, wired):
    trial, emulator = run(in_memory, wired, "bus-off")
    assert trial.fault["fault"] == Fault.RIG_FAILURE
    assert "is off" in trial.fault["text"]
    check_stopped(trial, emulator)


def odrive_of_firmware_05(text):
    return text.replace('"0.6"', '"0.5"\ntorque_constant_nm_per_a = 0.04')


def stopped_without_commands(in_memory, seconds):
    """Stop an ODrive of firmware 0.5 with a torque constant; lose all frames to it from then on.

    Return the travel of the slave [m], the drives that are enabled, and the faults.
    """
    emulators = []
    trial = in_memory("odrive-reaction-force", edit=odrive_of_firmware_05, prepare=emulators.append)
    clock = make_clock(trial.settings)
    with contextlib.suppress(NotStoppedError), trial.make_rig(clock.now) as rig:
        (emulator,) = emulators
        device, lost_until = emulator.devices["slave"], -math.inf
        receive = device.receive
        device.receive = lambda frame, now: now < lost_until or receive(frame, now)
        controller = make_controller(trial.settings, rig, clock)
        for n in range(1500):
            tick, stop = clock.wait(), n == 430
            if stop:
                start, lost_until = emulator.mechanism.rig.plant.slave.x, rig.present() + seconds
                assert abs(emulator.mechanism.rig.plant.slave.v) > 5e-3
            controller.tick(tick, Request(arm=True, faults=(KEY,) * stop))
        travel = emulator.mechanism.rig.plant.slave.x - start
    faults = [cause.fault for cause in controller._supervision.causes]
    return travel, emulator.mechanism.driven, faults


@pytest.mark.parametrize("lost", [3e-3, 0.02, 1.0])
def test_an_odrive_that_loses_the_stop_request_is_stopped_nevertheless(in_memory, lost):
    travel, driven, faults = stopped_without_commands(in_memory, lost)
    assert abs(travel) < 1e-3
    assert not driven
    assert faults == [Fault.EMERGENCY_STOP]


def disobedient(emulator):
    """Make the slave's ODrive ignore every stop, and its watchdog."""
    device = emulator.devices["slave"]
    device._expired = lambda now: False
    enter = device._enter
    device._enter = lambda state, now: None if emulator.mechanism.driven else enter(state, now)


def test_an_odrive_that_does_not_confirm_the_end_of_a_trial_is_a_safety_stop(in_memory):
    trial = in_memory("odrive-reaction-force", duration=0.3, rate=RATE, prepare=disobedient).run()
    assert trial.fault["fault"] == Fault.NOT_STOPPED
    assert "drive slave: no confirmation within 0.5 s" in trial.stop_text
    assert trial.recording.events[-1]["fault"] == Fault.NOT_STOPPED


def test_an_odrive_that_moves_on_after_a_fault_is_reported_as_the_worst_fault(
    in_memory, monkeypatch
):
    monkeypatch.setattr("teleop.trial.loop.AFTER", 0.8)

    def prepare(emulator):
        disobedient(emulator)
        set_value = emulator.devices["slave"]._set

        def keep_moving(command, data, now):
            set_value(command, data, now)
            if now > emulator._started + AT:
                emulator.devices["slave"]._input_vel = -2.0

        emulator.devices["slave"]._set = keep_moving

    trial = in_memory("odrive-reaction-force", duration=0.45, rate=RATE, prepare=prepare).run()
    assert trial.fault["fault"] == Fault.MOVES_AFTER_STOP
    assert ": the slave does not follow its command: " in trial.stop_text
    assert "the slave moves although its drives are disabled: -" in trial.stop_text
    assert "use the hardware emergency stop" in trial.stop_text


def test_error_frames_do_not_stop_the_run_while_other_frames_arrive(in_memory):
    trial, _ = run(in_memory, ODRIVE, "error-frames")
    assert trial.fault is None


def test_a_board_of_another_version_is_refused_at_the_start(stepped):
    def newer(emulator):
        emulator.devices["board"].version = 3

    with pytest.raises(RigError, match="protocol version 3, expected 1 or 2"):
        stepped("serial-board", prepare=newer).run()
