"""Trials on emulated devices that are connected by a network or by CAN FD."""

from __future__ import annotations

import pytest

from drivers import RigError
from sim_backend.wire.emulator import PlannedFault
from teleop.safety import Fault, Mode

AT = 0.2
"""Time of a fault after the drives were enabled [s]."""
RATE = 500.0
"""Rate of the loop [Hz]."""


def on_tcp(text):
    """Connect the microcontroller board by TCP."""
    return text.replace(
        'kind = "serial"\nport = "/dev/ttyACM0"', 'kind = "tcp"\nhost = "192.168.1.5"\nport = 4001'
    )


@pytest.mark.parametrize("kind", ["double", "corrupt", "noise", "truncate", "length"])
def test_a_board_on_tcp_tolerates_what_a_board_on_a_serial_line_tolerates(in_memory, kind):
    fault = PlannedFault(kind, "usb", AT)
    trial = in_memory("serial-board", duration=0.45, rate=RATE, faults=[fault], edit=on_tcp).run()
    assert trial.fault is None
    assert trial.recording["contact_force_age"].max() < 0.02


@pytest.mark.parametrize("kind", ["silence", "unplug"])
def test_a_lost_tcp_connection_stops_the_rig(in_memory, kind):
    faults = [PlannedFault(kind, "usb", AT), PlannedFault("replug", "usb", AT + 0.1)]
    trial = in_memory(
        "serial-board",
        duration=0.45,
        rate=RATE,
        faults=faults[: 1 + (kind == "unplug")],
        edit=on_tcp,
    ).run()
    if kind == "unplug":
        assert trial.fault["fault"] == Fault.RIG_FAILURE
        assert "is disconnected: " in trial.fault["text"]
    else:
        assert trial.fault["fault"] == Fault.STALE
    assert trial.recording["mode"][-1] == Mode.FAULT


def run_netft(trials, kind="", again="", bus="contact", duration=0.6, **options):
    """Run a trial on the rig with Net F/T sensors; return the trial and the emulator."""
    emulators = []
    faults = [PlannedFault(k, bus, AT + n * 0.1) for n, k in enumerate((kind, again)) if k]
    trial = trials(
        "ati-netft",
        duration=duration,
        rate=RATE,
        faults=faults,
        prepare=emulators.append,
        **options,
    ).run()
    return trial, emulators[0]


def test_a_trial_with_net_ft_sensors_estimates_the_cube(in_memory):
    trial, _ = run_netft(in_memory, duration=2.5)
    assert trial.fault is None
    assert trial.recording["contact_force_age"].max() < 0.01
    assert trial.summary()["estimates"]["rls"]["k"] == pytest.approx(2000.0, rel=0.1)


@pytest.mark.parametrize("kind", ["drop", "gaps", "double", "reorder", "truncate", "length"])
def test_net_ft_sensors_tolerate_lost_repeated_and_malformed_records(in_memory, kind):
    trial, _ = run_netft(in_memory, kind)
    assert trial.fault is None
    assert trial.recording["contact_force_age"].max() < 0.02


@pytest.mark.parametrize("kind", ["silence", "delay", "unplug"])
@pytest.mark.parametrize("bus", ["contact", "handle"])
def test_a_net_ft_sensor_without_new_records_is_reported_as_stale(in_memory, kind, bus):
    trial, emulator = run_netft(in_memory, kind, "replug" if kind == "unplug" else "", bus)
    assert trial.fault["fault"] == Fault.STALE
    assert AT < trial.fault["time"] < AT + 0.1
    assert trial.recording["mode"][-1] == Mode.FAULT
    assert not emulator.mechanism.driven


@pytest.mark.parametrize("kind", ["corrupt", "noise"])
def test_records_without_a_checksum_are_used_or_stop_the_rig(in_memory, kind):
    trial, emulator = run_netft(in_memory, kind)
    if trial.fault:
        assert trial.fault["time"] > AT
        assert not emulator.mechanism.driven


def test_a_sensor_that_was_restarted_stops_the_rig(in_memory):
    trial, _ = run_netft(in_memory, "reset")
    assert trial.fault["fault"] == Fault.STALE


def test_a_sensor_with_another_scale_is_refused(in_memory):
    with pytest.raises(RigError, match="contact: http.*: counts_per_n 1000000, expected 2000000"):
        in_memory(
            "ati-netft", rewrite=lambda text: text.replace("_n = 1_000_000 ", "_n = 2_000_000 ")
        ).run()


def on_virtual_bus(text):
    """Connect the moteus controllers by a virtual CAN FD bus of this process."""
    return text.replace('"socketcan"', '"virtual"').replace('"can0"', '"moteus-test"')


def run_moteus(trials, kind="", where="can", duration=0.6, condition="autonomous"):
    """Run a trial on the rig with moteus controllers; return the trial and the emulator."""
    emulators = []
    faults = [PlannedFault(kind, where, AT)] if kind else []
    trial = trials(
        "moteus",
        condition,
        duration=duration,
        faults=faults,
        prepare=emulators.append,
        edit=on_virtual_bus,
    ).run()
    return trial, emulators[0]


def test_a_trial_with_moteus_controllers_estimates_the_cube(in_memory):
    trial, _ = run_moteus(in_memory, duration=2.5)
    assert trial.fault is None
    assert trial.recording["slave_position_age"].max() < 0.01
    assert trial.summary()["estimates"]["rls"]["k"] == pytest.approx(2000.0, rel=0.1)


@pytest.mark.parametrize("kind", ["drop", "gaps", "double", "reorder", "truncate", "length"])
def test_lost_repeated_and_malformed_frames_are_tolerated_or_the_coupling_stops(in_memory, kind):
    """With lost frames, the motor of the master acts too late: its coupling detects this."""
    trial, emulator = run_moteus(in_memory, kind)
    assert trial.recording["slave_position_age"].max() < 0.02
    if trial.fault:
        assert kind not in ("double", "reorder")
        assert "drive master: the coupling gives energy" in trial.fault["text"]
        assert not emulator.mechanism.driven


@pytest.mark.parametrize(
    ("kind", "where", "fault"),
    [
        ("silence", "can", Fault.STALE),
        ("delay", "can", Fault.STALE),
        ("reset", "slave", Fault.DRIVE_ERROR),
        ("reset", "master", Fault.DRIVE_ERROR),
    ],
)
def test_a_lost_moteus_controller_stops_the_rig(in_memory, kind, where, fault):
    trial, emulator = run_moteus(in_memory, kind, where)
    assert trial.fault["fault"] == fault
    assert AT < trial.fault["time"] < AT + 0.1
    assert trial.recording["mode"][-1] == Mode.FAULT
    assert not emulator.mechanism.driven


def run_haply(trials, kind="", where="handle", duration=0.6):
    """Run a trial on the rig with a Haply Inverse3 as master; return the trial and the emulator."""
    emulators = []
    faults = [PlannedFault(kind, where, AT)] if kind else []
    trial = trials(
        "haply", "autonomous", duration=duration, faults=faults, prepare=emulators.append
    ).run()
    return trial, emulators[0]


def test_a_trial_with_a_haply_inverse3_estimates_the_cube(in_memory):
    trial, emulator = run_haply(in_memory, duration=2.5)
    assert trial.fault is None
    assert trial.recording["master_position_age"].max() < 0.02
    assert trial.summary()["estimates"]["rls"]["k"] == pytest.approx(2000.0, rel=0.2)
    assert not emulator.mechanism.driven


@pytest.mark.parametrize(
    ("kind", "where", "faults"),
    [
        ("silence", "handle", {Fault.STALE, Fault.DRIVE_ERROR}),
        ("unplug", "handle", {Fault.RIG_FAILURE}),
        ("reset", "master", {Fault.STALE, Fault.DRIVE_ERROR}),
    ],
)
def test_a_lost_haply_service_stops_the_rig(in_memory, kind, where, faults):
    trial, _ = run_haply(in_memory, kind, where)
    assert trial.fault["fault"] in faults
    assert AT < trial.fault["time"] < AT + 0.1
    assert trial.recording["mode"][-1] == Mode.FAULT
