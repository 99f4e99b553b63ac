"""The emulated CiA 402 drive: with the master of canopen, and its timing."""

from __future__ import annotations

import itertools
import struct
import threading
import time
from collections import deque
from itertools import pairwise

import can
import canopen
import pytest
from canopen.objectdictionary import ODRecord, ODVariable, datatypes

from drivers.devices.cia402 import Cia402
from drivers.devices.cia402_settings import Cia402Settings
from drivers.transports.can_bus import CanBus
from sim_backend.wire.devices.cia402 import EmulatedCia402, SimulatedState

SETTINGS = Cia402Settings(
    kind="cia402", bus="can0", node_id=5, counts_per_turn=10_000, travel_mm_per_turn=5.0
)
U8, U16, U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
I8, I16, I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32
CHANNELS = itertools.count()


class Carriage:
    """Mount of the drive, which stores the velocities."""

    def __init__(self):
        self.velocity, self.position, self.force, self.braked = 0.0, 0.0, 0.0, False
        self.velocities = []

    def sense(self, signal):
        return getattr(self, signal)

    def drive(self, name, velocity):
        self.velocity, self.braked = velocity, False
        self.velocities.append(velocity)

    def brake(self, name):
        self.velocity, self.braked = 0.0, True


def dictionary():
    found = canopen.ObjectDictionary()
    variables = {
        0x1000: U32,
        0x1001: U8,
        0x1008: datatypes.VISIBLE_STRING,
        0x1017: U16,
        0x2FFF: U8,
        0x6007: I16,
        0x6040: U16,
        0x6041: U16,
        0x605A: I16,
        0x6060: I8,
        0x6061: I8,
        0x6064: I32,
        0x606C: I32,
        0x6077: I16,
        0x6085: U32,
        0x60FF: I32,
        0x6502: U32,
    }
    communication = {0: U8, 1: U32, 2: U8, 5: U16}
    mapping = {0: U8, **dict.fromkeys(range(1, 9), U32)}
    records = {
        0x1016: {0: U8, 1: U32, 2: U32},
        0x1029: {0: U8, 1: U8},
        **dict.fromkeys((0x1400, 0x1800, 0x1801, 0x1802), communication),
        **dict.fromkeys((0x1600, 0x1A00, 0x1A01, 0x1A02), mapping),
    }
    for index, kind in variables.items():
        entry = ODVariable(f"{index:04X}", index)
        entry.data_type = kind
        found.add_object(entry)
    for index, kinds in records.items():
        record = ODRecord(f"{index:04X}", index)
        for sub, kind in kinds.items():
            entry = ODVariable(f"{index:04X}:{sub}", index, sub)
            entry.data_type = kind
            record.add_member(entry)
        found.add_object(record)
    return found


class Served:
    """The emulated drive on a virtual CAN bus, in another thread."""

    def __init__(self, channel, settings=SETTINGS):
        self.mount = Carriage()
        self.drive = EmulatedCia402("drive", settings, self.mount)
        self._bus = can.Bus(interface="virtual", channel=channel)
        self._on = True
        self.sent = 0
        self.calls = deque()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self):
        while self._on:
            while self.calls:
                self.calls.popleft()()
            frame = self._bus.recv(1e-3)
            if frame:
                self.drive.receive(frame, time.monotonic())
            for out in self.drive.emit(time.monotonic()):
                self._bus.send(out)
                self.sent += 1

    def close(self):
        self._on = False
        self._thread.join()
        self._bus.shutdown()


def soon(condition):
    """Return whether a condition becomes true within the time limit."""
    end = time.monotonic() + 5.0
    while not condition() and time.monotonic() < end:
        time.sleep(1e-3)
    return condition()


@pytest.fixture
def channel():
    return f"cia402-{next(CHANNELS)}"


@pytest.fixture
def served(channel):
    served = Served(channel)
    assert soon(lambda: served.sent)  # the boot-up message, before which it receives nothing
    yield served
    served.close()


@pytest.fixture
def node(channel, served):
    """Master of canopen for a CiA 402 drive."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.01
    node = canopen.BaseNode402(5, dictionary())
    node.sdo.RESPONSE_TIMEOUT = 10.0  # s; 0.3 s are too short on a busy machine
    network.add_node(node)
    network.connect(interface="virtual", channel=channel)
    beats = []
    node.nmt.add_heartbeat_callback(beats.append)
    node.nmt.state = "RESET COMMUNICATION"
    assert soon(lambda: 0 in beats)
    yield node
    network.sync.stop()
    network.disconnect()


def map_pdos(node):
    maps = (
        (node.rpdo[1], 0x205, (0x6040, 0x60FF)),
        (node.tpdo[1], 0x185, (0x6041, 0x6064, 0x6061)),
        (node.tpdo[2], 0x285, (0x606C, 0x6077)),
    )
    for pdo, identifier, objects in maps:
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.cob_id, pdo.trans_type, pdo.enabled = identifier, 1, True
        pdo.save()


def operate(node):
    """Enable operation in csv mode with canopen, by PDO and SYNC."""
    map_pdos(node)
    node.nmt.state = "OPERATIONAL"
    node.setup_402_state_machine(read_pdos=False)
    node.rpdo[1].start(0.005)
    node.network.sync.start(0.005)
    node.op_mode = "CYCLIC SYNCHRONOUS VELOCITY"
    node.state = "OPERATION ENABLED"


def test_canopen_reads_numbers_and_strings(node):
    assert node.sdo[0x1000].raw & 0xFFFF == 402
    assert node.sdo[0x1008].raw == "emulated CiA 402 servo drive"
    assert node.is_op_mode_supported("CYCLIC SYNCHRONOUS VELOCITY")
    assert not node.is_op_mode_supported("HOMING")


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (lambda n: n.sdo[0x2FFF].raw, 0x06020000),
        (lambda n: n.sdo[0x1016][2].raw, 0x06090011),
        (lambda n: setattr(n.sdo[0x6041], "raw", 1), 0x06010002),
        (lambda n: n.sdo.download(0x1017, 0, b"\x01"), 0x06070010),
        (lambda n: setattr(n.sdo[0x6060], "raw", 6), 0x06090030),
        (lambda n: setattr(n.sdo[0x1A00][1], "raw", 0x60410010), 0x06010000),
        (lambda n: setattr(n.sdo[0x1800][1], "raw", 0x186), 0x06090030),
        (lambda n: setattr(n.sdo[0x1A01][1], "raw", 0x10080020), 0x06040041),
        (lambda n: setattr(n.sdo[0x1A01][1], "raw", 0x70000020), 0x06020000),
        (lambda n: setattr(n.sdo[0x1800][2], "raw", 255), 0x06090030),
        (lambda n: n.sdo.download(0x1017, 0, bytes(10)), 0x05040001),
    ],
)
def test_canopen_is_refused_with_the_abort_code_of_the_standard(node, request_, code):
    with pytest.raises(canopen.SdoAbortedError) as refused:
        request_(node)
    assert refused.value.code == code


def test_a_pdo_longer_than_a_frame_is_refused(node):
    for i, value in enumerate((0x60640020, 0x606C0020, 0x60410010), 1):
        node.sdo[0x1A01][i].raw = value
    with pytest.raises(canopen.SdoAbortedError) as refused:
        node.sdo[0x1A01][0].raw = 3
    assert refused.value.code == 0x06040042


def test_canopen_maps_pdos_and_reads_the_mapping_back(node):
    map_pdos(node)
    node.tpdo.read()
    assert [(v.index, v.length) for v in node.tpdo[1].map] == [
        (0x6041, 16),
        (0x6064, 32),
        (0x6061, 8),
    ]


def test_mapping_is_refused_while_operational(node):
    node.nmt.state = "OPERATIONAL"
    with pytest.raises(canopen.SdoAbortedError) as refused:
        node.sdo[0x1A00][0].raw = 0
    assert refused.value.code == 0x08000022


def test_canopen_enables_moves_and_stops_the_drive(served, node):
    operate(node)
    assert node.state == "OPERATION ENABLED"
    assert node.op_mode == "CYCLIC SYNCHRONOUS VELOCITY"
    node.rpdo[1][0x60FF].raw = 40_000
    assert soon(lambda: served.mount.velocity == pytest.approx(20e-3))
    served.mount.position = -3e-3
    assert soon(lambda: node.tpdo_values[0x6064] == -6_000)
    node.state = "SWITCH ON DISABLED"
    assert soon(lambda: served.mount.braked)


def test_canopen_sees_a_fault_and_resets_it(served, node):
    operate(node)
    served.calls.append(lambda: served.drive.fault(0x2310))
    assert soon(lambda: node.is_faulted())
    assert soon(lambda: [e.code for e in node.emcy.active] == [0x2310])
    node.controlword = 0x00
    assert soon(lambda: served.drive._controlword == 0x00)
    node.controlword = 0x80
    assert soon(lambda: not node.is_faulted())
    assert soon(lambda: not node.emcy.active)


def test_without_canopen_s_heartbeat_the_drive_stops_and_reports_it(served, node):
    node.sdo[0x1016][1].raw = 127 << 16 | 200
    node.sdo[0x6007].raw = 3
    operate(node)
    node.rpdo[1][0x60FF].raw = 40_000
    task = node.network.send_periodic(0x77F, b"\x05", 0.02)
    assert soon(lambda: served.mount.velocity > 0)
    task.stop()
    assert soon(lambda: 0x8130 in [e.code for e in node.emcy.log])
    assert soon(lambda: served.mount.braked)


def test_driver_and_emulated_drive_work_on_a_socketcan_bus(channel, served):
    bus = CanBus("can0", time.monotonic, "virtual", channel, None, {})
    driver = Cia402("drive", SETTINGS)
    bus.open()
    bus.attach(driver.identifiers(), driver.receive)
    try:
        driver.start(bus)
        bus.wait_for(lambda: turn(bus, driver) or driver.enable(), 5.0)
        driver.command(20e-3)
        bus.wait_for(lambda: turn(bus, driver) or served.mount.velocity, 5.0)
        assert served.mount.velocity == pytest.approx(20e-3)
        driver.idle()
        driver.stop()
        assert soon(lambda: served.mount.braked)
    finally:
        bus.close()


def turn(bus, driver):
    driver.update(bus.now())
    driver.transmit()


class Clockwork:
    """The drive in virtual time, with the frames that it sends."""

    def __init__(self):
        self.mount = Carriage()
        self.drive = EmulatedCia402("drive", SETTINGS, self.mount)
        self.time = 7.0
        self.sent = []
        self.run(0.05)
        self.send(0x000, b"\x01\x05")

    def run(self, seconds, step=1e-3):
        for _ in range(round(seconds / step)):
            self.time += step
            self.collect()

    def collect(self):
        self.sent += [(f.arbitration_id, bytes(f.data)) for f in self.drive.emit(self.time)]

    def send(self, identifier, data):
        frame = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        self.drive.receive(frame, self.time)
        self.collect()

    def operate(self, velocity=50e-3):
        for index, value in ((0x6060, 9), (0x6007, 3), (0x60FF, round(velocity * 2e6))):
            self.drive.write(index, 0, value)
        for controlword in (0x06, 0x07, 0x0F):
            self.send(0x205, struct.pack("<H", controlword))
            self.send(0x080, b"")
        assert self.drive.state is SimulatedState.OPERATION_ENABLED

    def emergencies(self):
        return [int.from_bytes(data[:2], "little") for i, data in self.sent if i == 0x085]


def test_it_sends_boot_up_once_and_no_further_unrequested_frame():
    clockwork = Clockwork()
    clockwork.run(1.0)
    assert clockwork.sent == [(0x705, b"\0")]


def test_it_is_braked_from_power_up():
    assert Clockwork().mount.braked


def test_a_synchronous_command_waits_for_sync():
    clockwork = Clockwork()
    clockwork.send(0x205, b"\x06\x00")
    assert clockwork.drive.state is SimulatedState.SWITCH_ON_DISABLED
    clockwork.send(0x080, b"")
    assert clockwork.drive.state is SimulatedState.READY_TO_SWITCH_ON


def test_an_event_driven_command_does_not_wait_for_sync():
    clockwork = Clockwork()
    clockwork.drive.write(0x1400, 2, 255)
    clockwork.send(0x205, b"\x06\x00")
    assert clockwork.drive.state is SimulatedState.READY_TO_SWITCH_ON


def test_a_pdo_of_every_third_sync_answers_every_third():
    clockwork = Clockwork()
    clockwork.drive.write(0x1800, 2, 3)
    for _ in range(9):
        clockwork.send(0x080, b"")
    assert sum(identifier == 0x185 for identifier, _ in clockwork.sent) == 3


def test_a_short_pdo_is_rejected_and_reported():
    clockwork = Clockwork()
    clockwork.send(0x205, b"\x06")
    clockwork.send(0x080, b"")
    assert clockwork.drive.state is SimulatedState.SWITCH_ON_DISABLED
    assert clockwork.emergencies() == [0x8210]


def test_pdos_are_ignored_unless_operational():
    clockwork = Clockwork()
    clockwork.send(0x000, b"\x80\x05")
    clockwork.sent.clear()
    clockwork.send(0x205, b"\x06\x00")
    clockwork.send(0x080, b"")
    assert clockwork.drive.state is not SimulatedState.READY_TO_SWITCH_ON
    assert not [i for i, _ in clockwork.sent if i == 0x185]


def test_quick_stop_ramps_at_6085h_and_then_brakes():
    clockwork = Clockwork()
    clockwork.operate()
    clockwork.mount.velocities.clear()
    clockwork.send(0x205, b"\x02\x00")
    clockwork.send(0x080, b"")
    clockwork.run(0.1)
    falls = [a - b for a, b in pairwise(clockwork.mount.velocities)]
    assert max(falls) == pytest.approx(2.0 * 1e-3)
    assert len(falls) >= 24
    assert clockwork.mount.braked
    assert clockwork.drive.state is SimulatedState.SWITCH_ON_DISABLED


def test_quick_stop_option_6_stays_in_quick_stop_at_standstill():
    clockwork = Clockwork()
    clockwork.drive.write(0x605A, 0, 6)
    clockwork.operate()
    clockwork.drive._obey(0x02)
    clockwork.run(0.1)
    assert clockwork.drive.state is SimulatedState.QUICK_STOP_ACTIVE
    assert clockwork.mount.velocity == 0.0
    assert not clockwork.mount.braked


@pytest.mark.parametrize("loss", ["heartbeat", "RPDO"])
def test_without_its_master_it_stops_and_reports_the_reason(loss):
    clockwork = Clockwork()
    clockwork.drive.write(0x1016, 1, 127 << 16 | 50)
    clockwork.drive.write(0x1400, 5, 50)
    clockwork.drive.write(0x1029, 1, 1)
    clockwork.operate()
    clockwork.send(0x77F, b"\x05")
    for _ in range(10):
        clockwork.run(0.02)
        if loss != "heartbeat":
            clockwork.send(0x77F, b"\x05")
        if loss != "RPDO":
            clockwork.send(0x205, b"\x0f\x00")
    assert clockwork.mount.braked
    assert clockwork.emergencies() == [{"heartbeat": 0x8130, "RPDO": 0x8250}[loss]]
    clockwork.send(0x77F, b"\x05")
    clockwork.send(0x205, b"\x0f\x00")
    assert clockwork.emergencies()[-1] == 0


def test_no_heartbeat_is_missed_before_the_first():
    clockwork = Clockwork()
    clockwork.drive.write(0x1016, 1, 127 << 16 | 50)
    clockwork.run(1.0)
    assert not clockwork.emergencies()


@pytest.mark.parametrize(
    ("option", "state", "nmt"),
    [
        (0, SimulatedState.OPERATION_ENABLED, 0x7F),
        (1, SimulatedState.FAULT, 0x7F),
        (2, SimulatedState.SWITCH_ON_DISABLED, 0x7F),
        (3, SimulatedState.SWITCH_ON_DISABLED, 0x7F),
    ],
)
def test_the_reaction_to_the_loss_of_the_master_follows_6007h(option, state, nmt):
    clockwork = Clockwork()
    clockwork.operate()
    clockwork.drive.write(0x6007, 0, option)
    clockwork.drive.write(0x1016, 1, 127 << 16 | 50)
    clockwork.send(0x77F, b"\x05")
    clockwork.run(0.2)
    assert clockwork.drive.state is state
    assert clockwork.drive.nmt == nmt


def test_only_a_rising_edge_resets_a_fault():
    clockwork = Clockwork()
    clockwork.drive._obey(0x80)
    clockwork.drive.fault(0x4310)
    clockwork.drive._obey(0x80)
    assert clockwork.drive.state is SimulatedState.FAULT
    clockwork.drive._obey(0x00)
    clockwork.drive._obey(0x80)
    assert clockwork.drive.state is SimulatedState.SWITCH_ON_DISABLED


def test_a_fault_in_operation_brakes_and_ignores_commands():
    clockwork = Clockwork()
    clockwork.operate()
    clockwork.drive.fault(0x2310)
    clockwork.run(0.1)
    for controlword in (0x06, 0x07, 0x0F):
        clockwork.drive._obey(controlword)
    assert clockwork.drive.state is SimulatedState.FAULT
    assert clockwork.mount.braked
    assert clockwork.emergencies() == [0x2310]


def test_reset_communication_forgets_the_set_up_and_keeps_the_parameters():
    clockwork = Clockwork()
    clockwork.drive.write(0x1017, 0, 10)
    clockwork.drive.write(0x6007, 0, 3)
    clockwork.send(0x000, b"\x82\x05")
    clockwork.run(0.05)
    assert clockwork.drive[0x1017, 0] == 0
    assert clockwork.drive[0x6007, 0] == 3
    clockwork.send(0x000, b"\x81\x00")
    clockwork.run(0.05)
    assert clockwork.drive[0x6007, 0] == 1
    assert [data for i, data in clockwork.sent if i == 0x705][-2:] == [b"\0", b"\0"]


def test_heartbeats_come_at_their_period_and_a_late_call_gets_a_few():
    clockwork = Clockwork()
    clockwork.drive.write(0x1017, 0, 10)
    clockwork.sent.clear()
    clockwork.run(0.1)
    assert 9 <= len(clockwork.sent) <= 11
    assert set(clockwork.sent) == {(0x705, b"\x05")}
    clockwork.sent.clear()
    clockwork.run(10.0, step=10.0)
    assert 1 <= len(clockwork.sent) <= 5


def test_torque_is_in_thousandths_of_the_rated_torque():
    clockwork = Clockwork()
    clockwork.mount.force = 10.0
    clockwork.run(2e-3)
    torque = clockwork.drive[0x6077, 0] * 1e-3 * clockwork.drive[0x6076, 0] * 1e-3
    assert torque == pytest.approx(10.0 * 5e-3 / (2 * 3.141592653589793), rel=0.02)


def test_a_position_beyond_32_bits_wraps():
    clockwork = Clockwork()
    clockwork.mount.position = ((1 << 31) + 5) / 2e6
    clockwork.run(2e-3)
    assert clockwork.drive[0x6064, 0] == -(1 << 31) + 5


@pytest.mark.parametrize("identifier", [0x000, 0x080, 0x205, 0x605, 0x705, 0x77F])
def test_random_frames_on_the_bus_cause_no_error(identifier):
    clockwork = Clockwork()
    for length in range(9):
        clockwork.send(identifier, bytes(range(0xA0, 0xA0 + length)))
        clockwork.send(identifier, bytes(length))
    clockwork.run(0.1)
