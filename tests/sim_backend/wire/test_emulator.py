"""The emulator: planned faults, resets, and the reset of the plant between trials."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.rig_file import parse_rig_file, read_rig_file
from sim_backend import CUBES, SimulatedRig
from sim_backend.wire.emulator import Emulator, PlannedFault, host_file, host_ports
from sim_backend.wire.mechanism import NEVER, PUT_BACK
from sim_backend.wire.wire_faults import Silent

RIGS = Path(__file__).parents[3] / "rigs"


class Clock:
    """A clock that a test sets."""

    now = 0.0

    def __call__(self):
        return self.now


def make_rig(now, enabled):
    return SimulatedRig(CUBES["soft"], now, watchdog=NEVER)


def emulator(name, folder, clock, *faults):
    return Emulator(read_rig_file(RIGS / f"{name}.toml"), make_rig, folder, faults, clock)


def run(emulated, clock, seconds):
    """Run steps of 1 ms while the slave is driven."""
    end = clock.now + seconds
    while clock.now < end:
        clock.now += 1e-3
        emulated.step()


def test_a_fault_starts_at_its_time_after_the_drives_were_enabled(tmp_path):
    clock = Clock()
    emulated = emulator("serial-board", tmp_path, clock, PlannedFault("silence", "usb", 0.5))
    run(emulated, clock, 1.0)
    assert emulated.wires["usb"].to_devices is None
    emulated.mechanism.drive("slave", 0.0)
    run(emulated, clock, 0.49)
    assert emulated.wires["usb"].to_devices is None
    run(emulated, clock, 0.05)
    assert isinstance(emulated.wires["usb"].to_host, Silent)
    assert isinstance(emulated.wires["usb"].to_devices, Silent)


def test_a_device_that_is_reset_is_a_new_one_on_the_same_wire(tmp_path):
    emulated = emulator("odrive-bota", tmp_path, Clock())
    old = emulated.devices["slave"]
    emulated.inject(PlannedFault("reset", "slave", 0.0))
    assert emulated.devices["slave"] is not old
    assert emulated.devices["slave"] in emulated.wires["can"].devices
    assert old not in emulated.wires["can"].devices


def test_the_plant_is_reset_after_its_drives_have_been_idle(tmp_path):
    clock = Clock()
    emulated = emulator("serial-board", tmp_path, clock)
    mechanism = emulated.mechanism
    mechanism.drive("slave", 0.02)
    for _ in range(200):
        clock.now += 1e-3
        mechanism.advance()
    mechanism.brake("slave")
    clock.now += 0.9 * PUT_BACK
    assert mechanism.advance().slave_position == pytest.approx(4e-3, rel=0.2)
    clock.now += 0.2 * PUT_BACK
    assert mechanism.advance().slave_position == 0.0


def test_a_drive_that_is_enabled_before_the_reset_is_counted_as_early(tmp_path):
    clock = Clock()
    mechanism = emulator("serial-board", tmp_path, clock).mechanism
    counts = []
    for pause in (1.1 * PUT_BACK, 0.5 * PUT_BACK, 1.1 * PUT_BACK, 0.0):
        mechanism.drive("slave", 0.0)
        mechanism.drive("master", 0.0)
        counts.append(mechanism.early)
        mechanism.brake("slave")
        mechanism.brake("master")
        clock.now += pause
        mechanism.advance()
    assert counts == [0, 0, 1, 1]


def test_a_drive_senses_the_force_of_its_own_motor(tmp_path):
    clock = Clock()
    emulated = emulator("odrive-bota", tmp_path, clock)
    mechanism, mount = emulated.mechanism, emulated.mechanism.mounts["slave"]
    mechanism.drive("slave", 0.02)
    for _ in range(100):
        clock.now += 1e-3
        mechanism.advance()
    mechanism.drive("slave", 0.0)
    for _ in range(1000):
        clock.now += 1e-3
        mechanism.advance()
    assert mount.sense("force") == pytest.approx(mechanism.rig.plant.slave.force, rel=1e-3)
    assert mount.sense("position") == pytest.approx(mechanism.rig.plant.slave.x, abs=1e-6)


def test_a_udp_bus_without_a_device_is_named(tmp_path):
    path = RIGS / "ati-netft.toml"
    extra = '\n[buses.spare]\nkind = "udp"\nhost = "192.168.1.3"\nport = 49152\n'
    rig = parse_rig_file(path, path.read_text() + extra)
    with pytest.raises(ValueError, match="buses.spare: no device uses it"):
        Emulator(rig, make_rig, tmp_path)


def test_the_hosts_file_of_network_devices_has_their_ports(tmp_path):
    emulated = emulator("ati-netft", tmp_path, Clock())
    path = tmp_path / "run.toml"
    path.write_text(host_file(emulated))
    host = read_rig_file(path)
    for name in ("contact", "handle"):
        bus = host.sections.buses[name]
        assert (bus.host, bus.port) == tuple(emulated.wires[name].host_entries().values())
        assert host.devices[name].http_port not in (80, bus.port)
        assert host_ports(emulated)[name] == f"127.0.0.1:{bus.port}"


def test_the_hosts_file_has_the_pseudo_terminals_and_whole_paths(tmp_path):
    emulated = emulator("dbc-sensor", tmp_path, Clock())
    path = tmp_path / "elsewhere" / "run.toml"
    path.parent.mkdir()
    path.write_text(host_file(emulated))
    host = read_rig_file(path)
    ports = [
        bus.port if bus.kind == "serial" else bus.channel for bus in host.sections.buses.values()
    ]
    assert ports == [str(tmp_path / name) for name in emulated.wires]
