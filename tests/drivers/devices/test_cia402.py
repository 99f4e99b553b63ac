"""The driver of CiA 402 drives, with the emulated drive and with the local node of canopen."""

from __future__ import annotations

import math
import struct
import subprocess
import sys
from copy import deepcopy
from itertools import pairwise
from pathlib import Path

import can
import canopen
import pytest
from canopen.objectdictionary import ODRecord, ODVariable, datatypes
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from drivers.codecs.cia402 import DriveState
from drivers.device import NO_SAMPLE, ForceDrive, PositionDrive, VelocityDrive
from drivers.devices.cia402 import Cia402
from drivers.devices.cia402_settings import Cia402Settings
from drivers.rig import RigError
from sim_backend.wire.devices.canopen_sdo import Entry
from sim_backend.wire.devices.cia402 import EmulatedCia402
from sim_backend.wire.devices.cia402 import SimulatedState as Truth

TICK = 1e-3


def settings(**changes):
    values = {
        "kind": "cia402",
        "bus": "can0",
        "node_id": 5,
        "counts_per_turn": 10_000,
        "travel_mm_per_turn": 5.0,
    }
    return Cia402Settings(**values | changes)


class Carriage:
    """Mount of a drive."""

    def __init__(self):
        self.velocity, self.position, self.force, self.braked = 0.0, 0.0, 0.0, True

    def sense(self, signal):
        return getattr(self, signal)

    def drive(self, name, velocity):
        assert name == "axis"
        self.velocity, self.braked = velocity, False

    def push(self, name, force):
        assert name == "axis"
        self.force, self.braked = force, False

    def brake(self, name):
        assert name == "axis"
        self.velocity, self.braked = 0.0, True


class Wire:
    """A bus in virtual time between drivers and nodes."""

    name = "can0"

    def __init__(self):
        self.time, self.drivers, self.nodes = 100.0, [], []
        self.log = []
        self.cut = False

    def now(self):
        return self.time

    def send(self, identifier, data, extended=False):
        frame = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        self.log.append((identifier, bytes(data)))
        if not self.cut:
            for node in self.nodes:
                node.receive(frame, self.time)

    def poll(self):
        for node in self.nodes:
            for frame in node.emit(self.time):
                for driver in self.drivers:
                    if not self.cut and frame.arbitration_id in driver.identifiers():
                        driver.receive(frame, self.time)

    def wait_for(self, condition, seconds):
        end = self.time + seconds
        while not condition():
            if self.time > end:
                return False
            self.time += 0.5e-3
            self.poll()
        return True


class Bench:
    """One or more drives, each with its driver, on one wire."""

    def __init__(self, *all_settings):
        self.wire = Wire()
        self.mounts, self.drives, self.drivers = [], [], []
        for i, section in enumerate(all_settings or (settings(),)):
            mount = Carriage()
            self.mounts.append(mount)
            self.drives.append(EmulatedCia402(f"drive{i}", section, mount))
            self.drivers.append(Cia402(f"drive{i}", section))
        self.wire.nodes, self.wire.drivers = self.drives, self.drivers
        self.mount, self.drive, self.driver = self.mounts[0], self.drives[0], self.drivers[0]
        self.axis = self.driver.drives["axis"]

    def start(self):
        for driver in self.drivers:
            driver.start(self.wire)
        return self

    def tick(self, count=1, velocity=None, enabling=False, writes=True):
        """Run a tick of a rig: read, enable, command, transmit."""
        for _ in range(count):
            self.wire.time += TICK
            for mount in self.mounts:
                mount.position += mount.velocity * TICK
            self.wire.poll()
            for driver in self.drivers:
                driver.update(self.wire.time)
            if enabling:
                for driver in self.drivers:
                    driver.enable()
            for driver in self.drivers if writes else ():
                if velocity is not None:
                    driver.command(velocity)
                driver.transmit()

    def enable(self):
        self.start()
        self.arm()
        return self

    def arm(self, ticks=50):
        for _ in range(ticks):
            ready = [driver.enable() for driver in self.drivers]
            if all(ready):
                return True
            self.tick()
        return False


def test_after_start_every_signal_has_a_sample_and_the_drive_is_idle():
    bench = Bench()
    bench.mount.position, bench.mount.force = 12e-3, 3.0
    bench.start()
    assert bench.driver.samples["position"].value == pytest.approx(12e-3, abs=1e-6)
    assert bench.driver.samples["force"].value == pytest.approx(3.0, abs=0.2)
    assert bench.mount.braked
    assert bench.drive.state is Truth.SWITCH_ON_DISABLED
    assert not bench.driver.error
    assert bench.driver.signals().keys() == bench.driver.samples.keys()


def test_an_enabled_drive_follows_the_velocity_from_the_first_tick():
    bench = Bench().enable()
    applied = bench.driver.command(12.34567e-3)
    bench.driver.transmit()
    assert bench.mount.velocity == pytest.approx(applied)
    assert applied == pytest.approx(12.34567e-3, abs=0.25e-6)


@pytest.mark.parametrize("unit", ["counts_per_s", "rpm", "milli_rpm"])
def test_motion_is_reported_in_si_units(unit):
    bench = Bench(settings(velocity_unit=unit)).enable()
    applied = bench.driver.command(20e-3)
    bench.tick(100)
    assert applied == pytest.approx(20e-3, abs=50e-6)
    assert bench.driver.samples["velocity"].value == pytest.approx(applied)
    assert bench.driver.samples["position"].value == pytest.approx(bench.mount.position, abs=21e-6)


def test_another_velocity_unit_of_the_drive_is_changed():
    bench = Bench(settings(velocity_unit="rpm"))
    bench.drive.objects[0x60A9, 0].value = 0x00B50300
    bench.enable()
    bench.driver.command(10e-3)
    bench.driver.transmit()
    assert bench.mount.velocity == pytest.approx(10e-3)


def test_a_velocity_unit_that_cannot_be_set_is_refused():
    bench = Bench(settings(velocity_unit="rpm"))
    bench.drive.objects[0x60A9, 0] = Entry("I", 0x00B50300)
    with pytest.raises(RigError, match=r"drive0: node 5 on can0: writing .* 60A9h:00 is refused"):
        bench.start()


def test_a_read_only_velocity_unit_that_is_known_is_named():
    bench = Bench(settings(velocity_unit="rpm"))
    bench.drive.objects[0x60A9, 0] = Entry("I", 0xFDB44700)
    with pytest.raises(RigError, match=r"60A9h:00 is refused.*: expected velocity_unit milli_rpm"):
        bench.start()


def test_samples_have_the_time_of_their_sync():
    bench = Bench().start()
    bench.tick()
    sent = bench.wire.time
    bench.tick()
    assert bench.driver.samples["position"].time == sent
    assert bench.driver.samples["velocity"].time == sent


def test_samples_continue_without_commands():
    bench = Bench().start()
    bench.tick(100, writes=False)
    assert bench.wire.time - bench.driver.samples["position"].time < 15e-3
    assert not bench.driver.error


def test_a_command_before_it_is_enabled_does_not_move_it():
    bench = Bench().start()
    bench.tick(20, velocity=0.05)
    assert bench.mount.braked
    assert bench.mount.velocity == 0.0


def test_it_is_at_standstill_when_it_gets_enabled():
    bench = Bench().start()
    bench.tick(3, velocity=0.05)
    assert bench.arm()
    bench.driver.transmit()
    assert bench.mount.velocity == 0.0


def test_idle_stops_it_on_the_ramp_and_brakes():
    bench = Bench().enable()
    bench.tick(20, velocity=50e-3)
    bench.driver.idle()
    speeds = []
    for _ in range(60):
        bench.tick()
        speeds.append(bench.mount.velocity)
    assert all(a >= b for a, b in pairwise(speeds))
    assert 0 < speeds[0] < 50e-3
    assert bench.mount.braked
    assert bench.drive.state is Truth.SWITCH_ON_DISABLED
    assert not bench.driver.error


def test_idle_may_be_repeated_and_come_before_start():
    driver = Cia402("early", settings())
    driver.idle()
    driver.transmit()
    driver.update(0.0)
    driver.stop()
    bench = Bench().enable()
    bench.driver.idle()
    bench.driver.idle()
    assert bench.drive.state is not Truth.OPERATION_ENABLED


def test_it_can_be_enabled_again_after_idle():
    bench = Bench().enable()
    bench.driver.idle()
    bench.tick(60)
    assert bench.arm()


def test_two_drives_on_a_bus_share_one_sync_which_follows_both_commands():
    bench = Bench(settings(), settings(node_id=6)).enable()
    bench.wire.log.clear()
    bench.tick(velocity=10e-3)
    identifiers = [i for i, _ in bench.wire.log if i != 0x77F]
    assert identifiers == [0x205, 0x206, 0x080]
    assert [mount.velocity for mount in bench.mounts] == pytest.approx([10e-3, 10e-3])


def test_a_drive_is_not_lost_while_another_takes_long_to_start():
    bench = Bench(settings(watchdog_ms=40), settings(node_id=6, watchdog_ms=1000))
    bench.drivers[0].start(bench.wire)
    bench.wire.wait_for(lambda: False, 3.0)
    bench.drivers[1].start(bench.wire)
    bench.tick(10)
    assert [driver.error for driver in bench.drivers] == ["", ""]
    assert bench.arm()


def test_the_heartbeat_is_sent_at_the_pace_of_the_shortest_watchdog():
    bench = Bench(settings(watchdog_ms=40), settings(node_id=6, watchdog_ms=400)).enable()
    bench.wire.log.clear()
    bench.tick(100)
    beats = sum(identifier == 0x77F for identifier, _ in bench.wire.log)
    assert 9 <= beats <= 11


def test_drives_do_not_monitor_the_heartbeat_before_one_is_enabled():
    bench = Bench().start()
    bench.tick(10)
    bench.wire.wait_for(lambda: False, 3.0)
    bench.tick(10)
    assert not bench.driver.error
    assert bench.arm()


def test_a_bus_that_was_not_read_is_no_heartbeat_loss():
    bench = Bench().start()
    bench.wire.time += 5.0
    bench.driver.update(bench.wire.time)
    bench.tick(200)
    assert not bench.driver.error


@pytest.mark.parametrize("watchdog", ["heartbeat", "event timer"])
def test_reading_without_commands_does_not_keep_a_drive_going(watchdog):
    bench = Bench().enable()
    bench.drive.write(*{"heartbeat": (0x1400, 5, 0), "event timer": (0x1016, 1, 0)}[watchdog])
    bench.tick(20, velocity=50e-3)
    bench.tick(200, writes=False)
    assert bench.mount.braked
    code = {"heartbeat": "8130h", "event timer": "8250h"}[watchdog]
    assert code in bench.driver.error


def test_a_ping_is_answered_by_the_process_data():
    bench = Bench().start()
    bench.tick(5)
    assert bench.driver.ping()
    assert not bench.driver.answered()
    bench.wire.poll()
    assert bench.driver.answered()
    assert not Cia402("early", settings()).ping()


@pytest.mark.parametrize("watchdog", ["heartbeat", "event timer"])
def test_a_drive_stops_when_its_master_stops_sending(watchdog):
    bench = Bench().enable()
    if watchdog == "heartbeat":
        bench.drive.objects[0x1400, 5].value = 0
    bench.tick(20, velocity=50e-3)
    assert bench.mount.velocity == pytest.approx(50e-3)
    bench.wire.cut = True
    bench.tick(200, velocity=50e-3)
    assert bench.mount.braked
    assert bench.drive.state is Truth.SWITCH_ON_DISABLED
    assert bench.driver.error == "no heartbeat for 100 ms"


def test_a_drive_that_lost_the_controller_reports_it_until_it_is_enabled_again():
    bench = Bench().enable()
    bench.tick(20, velocity=50e-3)
    bench.wire.wait_for(lambda: False, 0.3)
    assert bench.mount.braked
    bench.tick(200, velocity=50e-3)
    assert "was missed (EMCY 8" in bench.driver.error
    assert bench.mount.braked
    assert not bench.driver.enable()
    bench.driver.idle()
    assert bench.driver.error
    assert bench.arm()
    assert not bench.driver.error


def test_a_drive_without_event_timer_is_monitored_by_heartbeat_only():
    bench = Bench()
    del bench.drive.objects[0x1400, 5]
    bench.drive._power_up.pop((0x1400, 5))
    del bench.drive.objects[0x1029, 1]
    bench.drive._power_up.pop((0x1029, 1))
    bench.start()


def test_a_fault_is_reported_and_reset_only_by_arming_again():
    bench = Bench().enable()
    bench.tick(20, velocity=50e-3)
    bench.drive.fault(0x2310)
    bench.tick(100, velocity=50e-3)
    assert bench.driver.error.startswith("continuous over-current at the output (EMCY 2310h")
    assert bench.drive.state is Truth.FAULT
    bench.driver.idle()
    bench.tick(100)
    assert bench.drive.state is Truth.FAULT
    assert bench.driver.error
    assert bench.arm()
    assert bench.drive.state is Truth.OPERATION_ENABLED
    assert not bench.driver.error


def test_after_an_error_only_quick_stop_and_standstill_are_sent():
    bench = Bench().enable()
    bench.tick(5, velocity=50e-3)
    bench.drive.emergency(0x8120, 0x11)
    bench.tick(5, velocity=50e-3)
    assert bench.driver.error.startswith("CAN error passive")
    sent = [data for identifier, data in bench.wire.log if identifier == 0x205]
    assert sent[-1] == struct.pack("<Hi", 0x02, 0)


@pytest.mark.parametrize("enabled", [True, False])
def test_a_fault_without_emergency_message_is_detected_in_the_statusword(enabled):
    bench = Bench().enable() if enabled else Bench().start()
    bench.tick()
    bench.drive.emergency = lambda code, register: None
    bench.drive.fault(0x2310)
    bench.tick(5)
    assert "fault" in bench.driver.error


def test_a_fault_that_comes_back_while_enabling_is_not_reset_again():
    bench = Bench().start()
    bench.drive.fault(0x4310)
    bench.tick(5)
    bench.driver.idle()
    bench.tick(5, enabling=True)
    assert bench.drive.state is not Truth.FAULT
    bench.drive.fault(0x4310)
    bench.tick(200, enabling=True)
    assert bench.drive.state is Truth.FAULT
    assert "power stage too hot" in bench.driver.error


def test_a_fault_that_a_reset_does_not_clear_is_reported():
    bench = Bench().start()
    bench.drive.fault(0x4310)
    bench.drive._obey = lambda controlword: None
    bench.tick(5)
    bench.driver.idle()
    bench.tick(600, enabling=True)
    assert bench.driver.error == "the fault is not cleared by a reset"


def test_a_drive_that_leaves_operation_is_reported_and_not_enabled_again():
    bench = Bench().enable()
    bench.drive._obey(0x00)
    bench.tick(50, velocity=50e-3)
    assert bench.driver.error.startswith("left operation by itself")
    assert bench.mount.braked


def test_a_reset_during_operation_is_an_error_until_a_new_set_up():
    bench = Bench().enable()
    bench.drive.receive(can.Message(data=[0x81, 5], is_extended_id=False), bench.wire.time)
    bench.tick(100, velocity=50e-3)
    assert bench.driver.error == "was reset during operation"
    assert bench.mount.braked
    bench.driver.idle()
    with pytest.raises(RigError, match="drive0: was reset during operation: .* open the rig again"):
        bench.driver.enable()
    bench.enable()
    assert bench.drive.state is Truth.OPERATION_ENABLED


def test_leaving_nmt_operational_is_an_error():
    bench = Bench().enable()
    bench.drive.receive(can.Message(data=[0x80, 5], is_extended_id=False), bench.wire.time)
    bench.tick(100, velocity=50e-3)
    assert bench.driver.error.startswith("left NMT operational: pre-operational")
    assert bench.mount.braked


def test_after_stop_it_reports_no_missing_heartbeat():
    bench = Bench().enable()
    bench.driver.idle()
    bench.driver.stop()
    seen = []
    for _ in range(500):
        bench.wire.time += TICK
        seen += [frame.arbitration_id for frame in bench.drive.emit(bench.wire.time)]
    assert 0x705 in seen
    assert 0x085 not in seen
    assert bench.mount.braked


@pytest.mark.parametrize("without_master", [0, 3])
def test_a_drive_left_running_by_a_killed_controller_is_stopped_by_the_next_start(without_master):
    bench = Bench().enable()
    bench.tick(20, velocity=50e-3)
    bench.drive.write(0x6007, 0, without_master)
    second = Cia402("drive0", settings())
    bench.wire.drivers = [second]
    second.start(bench.wire)
    assert bench.drive.state is not Truth.OPERATION_ENABLED


def test_the_drive_sends_only_the_two_mapped_pdos():
    bench = Bench().start()
    bench.tick(10)
    bench.wire.send(0x080, b"")
    answers = {frame.arbitration_id for frame in bench.drive.emit(bench.wire.time)}
    assert answers <= {0x185, 0x285, 0x705}


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        ((0x1000, 0), 0x00020191, r"object 1000h:00 is 0x20191: expected profile 402"),
        ((0x6502, 0), 0x0004, r"object 6502h:00 is 0x4: expected bit 8, cyclic synchronous vel"),
        ((0x1018, 1), 0x11, r"object 1018h:01 is 0x11: expected vendor_id 0x9A"),
        ((0x1018, 2), 0x12, r"object 1018h:02 is 0x12: expected product_code 0x60"),
    ],
)
def test_another_device_is_refused_in_one_line(at, value, message):
    bench = Bench(settings(vendor_id=0x9A, product_code=0x60))
    bench.drive.objects[at].value = value
    with pytest.raises(RigError, match=rf"^drive0: node 5 on can0: {message}[^\n]*$"):
        bench.start()


@pytest.mark.parametrize(
    ("stated", "vendor", "expected"),
    [("milli_nm", 0xFB, "micro_nm"), ("micro_nm", 0x9A, "milli_nm")],
)
def test_a_wrong_unit_of_the_torque_is_refused_before_the_drive_is_set_up(stated, vendor, expected):
    bench = Bench(settings(rated_torque_unit=stated))
    bench.drive.objects[0x1018, 1].value = vendor
    before = {at: e.value for at, e in bench.drive.objects.items() if e.writable}
    message = rf"rated_torque_unit {stated} for a drive .*maxon, vendor id 0x{vendor:X}: .*1000: "
    with pytest.raises(RigError, match=message + f"expected {expected}"):
        bench.start()
    assert {at: e.value for at, e in bench.drive.objects.items() if e.writable} == before


def test_a_drive_that_does_not_accept_the_mode_is_refused():
    bench = Bench()
    measure = bench.drive._measure

    def stubborn():
        measure()
        bench.drive.objects[0x6061, 0].value = 3

    bench.drive._measure = stubborn
    with pytest.raises(RigError, match=r"6061h:00 is 0x3: expected mode 9"):
        bench.start()


def test_a_drive_that_would_not_stop_without_its_master_is_refused():
    bench = Bench()
    del bench.drive.objects[0x6007, 0]
    bench.drive.connection_lost = lambda: None
    with pytest.raises(RigError, match=r"6007h:00 is refused: .*does not exist"):
        bench.start()


def test_a_heartbeat_right_after_the_boot_up_does_not_hide_it():
    bench = Bench()
    emit = bench.drive.emit

    def with_heartbeat(now):
        frames = emit(now)
        beat = can.Message(arbitration_id=0x705, data=b"\x7f", is_extended_id=False)
        return [*frames, beat] if any(f.data == b"\0" for f in frames) else frames

    bench.drive.emit = with_heartbeat
    bench.start()


def test_a_missing_node_is_an_error_after_the_wait_for_its_boot_up():
    bench = Bench()
    bench.wire.nodes = []
    with pytest.raises(RigError, match="drive0: node 5 on can0: no boot-up message within 5 s"):
        bench.start()


def test_a_node_that_does_not_answer_sdo_is_an_error():
    bench = Bench()
    bench.drive.sdo.answer = lambda request: None
    with pytest.raises(RigError, match=r"reading object 1000h:00: No SDO response|no answer"):
        bench.start()


def test_a_drive_without_rated_torque_has_no_force():
    bench = Bench()
    bench.drive.objects[0x6076, 0].value = 0
    bench.start()
    assert math.isnan(bench.driver.samples["force"].value)


@given(
    st.lists(
        st.tuples(st.sampled_from([0x085, 0x185, 0x285, 0x585, 0x705]), st.binary(max_size=8)),
        max_size=20,
    )
)
def test_malformed_frames_are_counted_and_never_raise(frames):
    driver = Cia402("drive", settings())
    for identifier, data in frames:
        driver.receive(can.Message(arbitration_id=identifier, data=data), 1.0)
    wrong = {0x085: 8, 0x185: 6, 0x285: 6}
    short = sum(len(data) != wrong.get(i, len(data)) for i, data in frames)
    assert driver.rejected["length"] == short
    assert driver.rejected["SDO"] == sum(i == 0x585 for i, _ in frames)


def test_a_remote_frame_is_not_processed_as_data():
    driver = Cia402("drive", settings())
    driver.receive(can.Message(arbitration_id=0x185, is_remote_frame=True, dlc=6), 1.0)
    assert driver.rejected == {"remote": 1}
    assert driver.samples["position"] == NO_SAMPLE or math.isnan(driver.samples["position"].value)


def test_an_undefined_statusword_is_counted():
    driver = Cia402("drive", settings())
    driver.receive(can.Message(arbitration_id=0x185, data=struct.pack("<Hi", 0x4C, 0)), 1.0)
    assert driver.rejected == {"statusword": 1}


@pytest.mark.parametrize(
    "wrong",
    [{"node_id": 127}, {"counts_per_turn": 0}, {"watchdog_ms": 10}, {"unit": "mm"}],
)
def test_settings_out_of_bounds_or_unknown_are_refused(wrong):
    with pytest.raises(ValidationError):
        settings(**wrong)


def test_only_a_rig_with_such_a_drive_imports_canopen():
    code = "import drivers.devices.cia402, sys; sys.exit('canopen' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("mode", "kind"), [("csv", VelocityDrive), ("csp", PositionDrive), ("cst", ForceDrive)]
)
def test_the_mode_chooses_what_the_drive_accepts(mode, kind):
    bench = Bench(settings(mode=mode)).start()
    assert isinstance(bench.axis, kind)
    number = {"csp": 8, "csv": 9, "cst": 10}[mode]
    assert bench.drive[0x6060, 0] == number
    bench.drive.objects[0x6502, 0].value = 1 << number - 1 ^ 0x380
    with pytest.raises(RigError, match=rf"object 6502h:00 .* expected bit {number - 1}, cyclic"):
        bench.start()


NEWTONS = 0.2 * 2e-3 * math.pi / 5e-3
"""Force of a thousandth of the rated torque of the emulated motor [N]."""


def push(bench, force, ticks=1):
    for _ in range(ticks):
        bench.tick(writes=False)
        applied = bench.axis.command(force)
        bench.driver.transmit()
    return applied


def test_in_the_torque_mode_it_is_enabled_without_force_and_then_exerts_the_commanded_one():
    bench = Bench(settings(mode="cst")).start()
    while not bench.axis.enable():
        push(bench, 20.0)
        assert not bench.mount.force
    applied = push(bench, -20.0)
    assert applied == pytest.approx(-20.0, abs=0.5 * NEWTONS)
    assert bench.mount.force == pytest.approx(applied)
    push(bench, 0.0)
    assert bench.mount.force == 0.0


@pytest.mark.parametrize(("most", "limit"), [(None, 2000), (500, 500)])
def test_a_force_is_limited_to_the_largest_torque_of_the_drive(most, limit):
    bench = Bench(settings(mode="cst"))
    if most:
        bench.drive.objects[0x6072, 0] = Entry("H", most)
    bench.enable()
    assert bench.axis.command(1e6) == pytest.approx(limit * NEWTONS)
    assert bench.axis.command(-1e6) == pytest.approx(-limit * NEWTONS)


@pytest.mark.parametrize("rated", [0, None])
def test_a_drive_without_rated_torque_is_refused_in_the_torque_mode(rated):
    bench = Bench(settings(mode="cst"))
    bench.drive.objects[0x6076, 0].value = 0
    if rated is None:
        del bench.drive.objects[0x6076, 0]
    with pytest.raises(RigError, match=r"object 6076h:00 is (0|missing): expected the rated torq"):
        bench.start()


def test_in_the_torque_mode_idle_and_a_lost_controller_switch_the_torque_off():
    bench = Bench(settings(mode="cst")).enable()
    assert bench.drive[0x6007, 0] == 2
    push(bench, 20.0, 5)
    assert not bench.axis.idle()
    assert bench.wire.log[-2][1] == bytes(4)
    assert bench.mount.braked
    assert bench.wire.wait_for(bench.axis.idle, 0.1)
    assert bench.arm()
    push(bench, 20.0, 5)
    assert not bench.mount.braked
    bench.tick(150, writes=False)
    assert bench.mount.braked
    assert bench.driver.error


def test_in_the_position_mode_it_is_enabled_at_its_present_position():
    bench = Bench(settings(mode="csp"))
    bench.mount.position = 7e-3
    bench.start()
    assert bench.drive[0x607A, 0] == 14_000
    while not bench.axis.enable():
        bench.axis.command(0.2)
        bench.driver.transmit()
        bench.mount.position += 1e-6
        bench.tick()
        assert abs(bench.mount.velocity) < 1e-3
    assert bench.mount.position == pytest.approx(7e-3, abs=1e-4)


def test_in_the_position_mode_it_follows_a_position():
    bench = Bench(settings(mode="csp")).enable()
    for i in range(300):
        applied = bench.axis.command(20e-3 * i * TICK)
        bench.tick()
    assert applied == pytest.approx(299 * 20e-6, abs=0.25e-6)
    assert bench.driver.samples["position"].value == pytest.approx(applied, abs=50e-6)
    bench.axis.idle()
    bench.tick(60)
    assert bench.mount.braked


KINDS = {"b": 2, "h": 3, "i": 4, "B": 5, "H": 6, "I": 7}
"""Data types of CANopen by the format character of the module `struct`."""


def epos4_like(bench):
    """Give the drive exactly the objects of the EDS file."""
    od = canopen.import_od(str(Path(__file__).with_name("epos4-like.eds")), 5)
    formats = {number: letter for letter, number in KINDS.items()}
    objects = {}
    for index, found in od.items():
        mapping = index & 0xFE00 in (0x1600, 0x1A00) and index < 0x2000
        for variable in [found] if isinstance(found, ODVariable) else found.values():
            for sub in range(variable.subindex, 9 if mapping else variable.subindex + 1):
                objects[index, sub] = Entry(
                    formats[variable.data_type],
                    variable.default or 0,
                    writable=mapping or "w" in variable.access_type,
                    mappable=variable.pdo_mappable,
                )
    bench.drive.objects.clear()
    bench.drive.objects.update(objects)
    bench.drive._power_up = deepcopy(objects)
    return bench


@pytest.mark.parametrize("mode", ["csv", "csp", "cst"])
def test_a_drive_like_an_epos4_is_set_up_and_its_force_has_the_true_size(mode):
    bench = Bench(settings(mode=mode, rated_torque_unit="micro_nm", velocity_unit="milli_rpm"))
    epos4_like(bench).enable()
    assert bench.drive[0x605A, 0] == 2
    if mode == "cst":
        newtons = 0.512871 * 2e-3 * math.pi / 5e-3
        assert bench.axis.command(100.0) == pytest.approx(100.0, abs=newtons)
        bench.driver.transmit()
        assert bench.drive[0x6071, 0] == round(100.0 / newtons)
    if mode == "csv":
        assert bench.axis.command(10e-3) == pytest.approx(10e-3, abs=1e-7)
        bench.driver.transmit()
        assert bench.drive[0x60FF, 0] == 120_000


def test_the_read_only_velocity_unit_of_such_a_drive_is_not_written():
    bench = epos4_like(Bench(settings(rated_torque_unit="micro_nm")))
    with pytest.raises(RigError, match="expected velocity_unit milli_rpm, as it is now"):
        bench.start()


class LocalNodeNetwork(canopen.Network):
    """Local node of canopen on the bus, with the NMT functions that it lacks."""

    def __init__(self):
        super().__init__()
        self.out = []
        dictionary = canopen.ObjectDictionary()
        for at, (kind, default) in OBJECTS.items():
            index, sub = at
            entry = ODVariable(f"{index:04X}:{sub}", index, sub)
            entry.data_type, entry.default = kind, default
            if index in RECORDS:
                if index not in dictionary:
                    dictionary.add_object(ODRecord(f"{index:04X}", index))
                dictionary[index].add_member(entry)
            else:
                dictionary.add_object(entry)
        self.node = self.create_node(canopen.LocalNode(5, dictionary))
        self.node.add_write_callback(self.follow_mode)

    def follow_mode(self, index, subindex, od, data):
        if index == 0x6060:
            self.node.data_store.setdefault(0x6061, {})[0] = bytes(data)

    def send_message(self, can_id, data, remote=False):
        self.out.append(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def send_periodic(self, can_id, data, period, remote=False):
        self.send_message(can_id, data)

        class Task:
            update = staticmethod(lambda data: self.send_message(can_id, data))
            stop = staticmethod(lambda: None)

        return Task

    def receive(self, frame, now):
        self.notify(frame.arbitration_id, frame.data, now)
        if frame.arbitration_id == 0x000 and frame.data[0] == 0x82:
            self.send_message(0x705, b"\0")
        if frame.arbitration_id == 0x080 and self.node.nmt.state == "OPERATIONAL":
            self.node.tpdo.read()
            self.node.tpdo[1][0x6041].raw = 0x0637
            self.node.tpdo[1][0x6064].raw = -2_000
            self.node.tpdo[2][0x606C].raw = 4_000
            self.node.tpdo[2][0x6077].raw = -250
            for number in (1, 2):
                self.node.tpdo[number].transmit()

    def emit(self, now):
        out, self.out = self.out, []
        return out


U8, U16, U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
I8, I16, I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32
PDOS = {0x1400: 0x1600, 0x1800: 0x1A00, 0x1801: 0x1A01, 0x1802: 0x1A02}
RECORDS = {0x1016, *PDOS, *PDOS.values()}
OBJECTS = {
    (0x1000, 0): (U32, 0x00020192),
    (0x1016, 0): (U8, 1),
    (0x1016, 1): (U32, 0),
    (0x1017, 0): (U16, 0),
    (0x6007, 0): (I16, 0),
    (0x6040, 0): (U16, 0),
    (0x6041, 0): (U16, 0),
    (0x6060, 0): (I8, 0),
    (0x6061, 0): (I8, 0),
    (0x6064, 0): (I32, 0),
    (0x606C, 0): (I32, 0),
    (0x6076, 0): (U32, 500),
    (0x6077, 0): (I16, 0),
    (0x60FF, 0): (I32, 0),
    (0x6502, 0): (U32, 0x100),
    **{(at, 0): (U8, 5) for at in PDOS},
    **{(at, 1): (U32, 0x385) for at in PDOS},
    **{(at, 2): (U8, 255) for at in PDOS},
    **{(at, 5): (U16, 0) for at in PDOS},
    **{(at, 0): (U8, 0) for at in PDOS.values()},
    **{(at, i): (U32, 0) for at in PDOS.values() for i in (1, 2)},
}


def test_canopen_s_node_is_set_up_correctly_and_its_pdos_are_decoded():
    wire, theirs, driver = Wire(), LocalNodeNetwork(), Cia402("drive", settings())
    wire.nodes, wire.drivers = [theirs], [driver]
    driver.start(wire)
    node = theirs.node
    node.tpdo.read()
    node.rpdo.read()
    mapped = {
        pdo.cob_id: [(var.index, var.length) for var in pdo.map]
        for pdo in (node.rpdo[1], node.tpdo[1], node.tpdo[2])
    }
    assert mapped == {
        0x205: [(0x6040, 16), (0x60FF, 32)],
        0x185: [(0x6041, 16), (0x6064, 32)],
        0x285: [(0x606C, 32), (0x6077, 16)],
    }
    for pdo in (node.rpdo[1], node.tpdo[1], node.tpdo[2]):
        assert pdo.enabled
        assert pdo.trans_type == 1
    assert not node.tpdo[3].enabled
    assert node.sdo[0x1400][5].raw == 100
    assert node.sdo[0x1016][1].raw == 127 << 16 | 100
    assert node.sdo[0x1017].raw == 25
    assert node.sdo[0x6007].raw == 3
    assert node.sdo[0x6060].raw == 9
    assert driver.samples["position"].value == pytest.approx(-1e-3)
    assert driver.samples["velocity"].value == pytest.approx(2e-3)
    assert driver.samples["force"].value == pytest.approx(-0.125 * 2 * math.pi / 5e-3)
    stated = driver.about()
    assert {name: stated[name] for name in ("1000h:00", "1016h:01", "6076h:00")} == {
        "1000h:00": "0x20192",
        "1016h:01": f"{127 << 16 | 100:#x}",
        "6076h:00": "0x1f4",
    }
    assert "1008h:00" not in stated  # this node has no such object
    driver.enable()
    driver.transmit()
    wire.wait_for(lambda: False, 5e-3)
    assert driver.enable()
    driver.command(3e-3)
    driver.transmit()
    assert node.rpdo[1][0x6040].raw == 0x0F
    assert node.rpdo[1][0x60FF].raw == 6_000
    assert DriveState.OPERATION_ENABLED.words == "operation enabled"
