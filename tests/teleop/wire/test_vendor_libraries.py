"""The libraries of vendors and of others accept the emulated devices, and agree with the drivers.

The emulated devices are written by us. If the library of a vendor reads them as its device, then a
driver that reads them correctly also reads the device.
"""

from __future__ import annotations

import contextlib
import json
import math
import subprocess
import sys
import threading
from collections import Counter
from itertools import pairwise
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs import mit_motor, moteus
from drivers.codecs.ft300 import Ft300Parser
from drivers.devices.mit_motor_settings import MitMotorSettings
from drivers.devices.moteus import MoteusSettings
from drivers.rig_file import read_rig_file
from sim_backend.wire.devices.mit_motor import EmulatedMitMotor
from sim_backend.wire.devices.moteus import EmulatedMoteus
from sim_backend.wire.emulated_device import Mount
from sim_backend.wire.emulator import host_file
from teleop.rig.emulation import make_emulator
from teleop.settings.trial_settings import TrialSettings

RIGS = Path(__file__).parents[3] / "rigs"


@contextlib.contextmanager
def served(name: str, folder: Path):
    """Emulate an example of a rig in a thread; yield the rig file for the host."""
    pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
    settings = TrialSettings(condition="autonomous")
    emulator = make_emulator(read_rig_file(RIGS / f"{name}.toml"), settings, folder)
    out = folder / "run.toml"
    out.write_text(host_file(emulator))
    stop = threading.Event()
    with emulator:
        thread = threading.Thread(target=emulator.serve, args=(stop.is_set,))
        thread.start()
        try:
            yield read_rig_file(out)
        finally:
            stop.set()
            thread.join()


def result_of(script: str, *arguments: object) -> dict:
    """Run a script in another process, which prints one JSON document as its last line.

    A library in this process could keep the interpreter from emulating the device.
    """
    words = [sys.executable, "-c", script, *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr + done.stdout
    line = next(line for line in done.stdout.splitlines() if line.startswith("{"))
    return dict(json.loads(line))


BOTA = """
import json, sys
import bota_driver as bd

config = bd.BotaDriverConfig()
config.product_name, config.serial_number = "BFT-SENS-SER-M8", "SN000001"
config.communication_interface_name = "Bota_Binary_gen0"
line = bd.BotaBinaryCommunicationInterfaceConfig()
line.com_port, line.baudrate = sys.argv[1], int(sys.argv[2])
config.binary_communication_interface_params = line
sensor = bd.Gen0SensorOperationConfig()
sensor.sinc_length = 64
config.gen0_sensor_operation_params = sensor
operation = bd.DriverOperationConfig()
operation.skip_metadata_reading = True
config.driver_operation_params = operation
driver = bd.BotaDriver(config)
assert driver.configure() and driver.activate()
frames = [driver.read_frame_blocking() for _ in range(200)]
driver.deactivate()
print()
print(json.dumps({
    "force": [list(frame.force) for frame in frames],
    "stamps": [frame.timestamp for frame in frames],
}))
"""


@pytest.mark.real_time
def test_the_driver_of_bota_systems_reads_the_emulated_sensor(tmp_path):
    pytest.importorskip("bota_driver")
    with served("odrive-bota", tmp_path) as rig:
        bus = rig.sections.buses[rig.devices["contact"].bus]
        found = result_of(BOTA, Path(bus.port).resolve(), bus.baud_bps)
    stamps = sorted(set(found["stamps"]))
    assert len(stamps) > 50
    periods = [b - a for a, b in pairwise(stamps)]
    assert sorted(periods)[len(periods) // 2] == 1250  # 800 samples per second, in us
    forces = [values[2] for values in found["force"]]
    assert max(map(abs, forces)) < 0.2  # nothing touches the sensor
    assert len(set(forces)) > 40  # but it has noise


DYNAMIXEL = """
import json, sys
from dynamixel_sdk import PacketHandler, PortHandler

port, servo = PortHandler(sys.argv[1]), int(sys.argv[2])
assert port.openPort() and port.setBaudRate(1000000)
packets = PacketHandler(2.0)
found = {
    "ping": packets.ping(port, servo),
    "model": packets.read2ByteTxRx(port, servo, 0),
    "write": packets.write1ByteTxRx(port, servo, 64, 1),
    "torque": packets.read1ByteTxRx(port, servo, 64),
    "off": packets.write1ByteTxRx(port, servo, 64, 0),
    "position": packets.read4ByteTxRx(port, servo, 132),
}
port.closePort()
print(json.dumps(found))
"""


@pytest.mark.real_time
def test_the_sdk_of_robotis_reads_and_writes_the_emulated_servo(tmp_path):
    pytest.importorskip("dynamixel_sdk")
    with served("dynamixel", tmp_path) as rig:
        servo = rig.devices["servo"]
        port = rig.sections.buses[servo.bus].port
        found = result_of(DYNAMIXEL, Path(port).resolve(), servo.id)
    no_error = [0, 0]
    assert found["ping"] == [1190, *no_error]
    assert found["model"] == [1190, *no_error]
    assert found["write"] == no_error
    assert found["torque"] == [1, *no_error]
    assert found["off"] == no_error
    assert found["position"][1:] == no_error


FT300 = """
import json, sys
import minimalmodbus

sensor = minimalmodbus.Instrument(sys.argv[1], 9)
sensor.serial.baudrate, sensor.serial.timeout = 19200, 1.0
sensor.write_register(410, 0x200, functioncode=16)  # checks the answer
data = sensor.serial.read(16 * 50)
sensor.serial.write(50 * bytes([0xFF]))
print(json.dumps({"frames": data.hex()}))
"""


@pytest.mark.real_time
def test_a_modbus_library_starts_the_stream_of_the_emulated_ft_300(tmp_path):
    pytest.importorskip("minimalmodbus")
    with served("cia402-ft300", tmp_path) as rig:
        name = next(name for name, one in rig.devices.items() if one.kind == "ft300")
        port = rig.sections.buses[rig.devices[name].bus].port
        found = result_of(FT300, Path(port).resolve())
    rejected: Counter[str] = Counter()
    frames = [*Ft300Parser(rejected).feed(bytes.fromhex(found["frames"]))]
    assert len(frames) == 50
    assert not rejected
    assert all(abs(frame.fz) < 0.5 for frame in frames)  # nothing touches the sensor


NETFT = """
import json, sys
import pynetft

host, rdt, http = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
config = pynetft.Config(sensor_host=host, rdt_port=rdt, http_port=http)
with pynetft.Client(config, queue_size=500) as client:
    assert client.wait_for_first_sample(5.0)
    samples = []
    for sample in client.samples(timeout=2.0):
        samples.append(sample)
        if len(samples) == 300:
            break
    health = client.health()
print(json.dumps({
    "force": [one.force[2] for one in samples],
    "numbers": [one.rdt_sequence for one in samples],
    "status": [one.status for one in samples],
    "faults": [health.fault_code.value, health.lost_count, health.duplicate_count,
               health.malformed_count, health.device_error_count],
    "source": health.sensor_configuration.source.value,
}))
"""


@pytest.mark.real_time
def test_an_independent_client_reads_the_emulated_net_ft(tmp_path):
    pytest.importorskip("pynetft")
    with served("ati-netft", tmp_path) as rig:
        name = next(name for name, one in rig.devices.items() if one.kind == "ati_netft")
        sensor = rig.devices[name]
        bus = rig.sections.buses[sensor.bus]
        found = result_of(NETFT, bus.host, bus.port, sensor.http_port)
    assert found["source"] == "sensor"  # its web page was understood
    assert found["faults"] == ["none", 0, 0, 0, 0]
    assert found["numbers"] == sorted(set(found["numbers"]))
    assert set(found["status"]) == {0}
    assert len(set(found["force"])) > 100
    assert max(map(abs, found["force"])) < 0.2  # nothing touches the sensor


class Shaft(Mount):
    """The mount of a motor, which turns freely at a given position and velocity."""

    rate = 1000.0

    def __init__(self, position=0.01, velocity=0.02, force=2.0):
        self.readings = {"position": position, "velocity": velocity, "force": force}
        self.velocity = self.force = None

    def sense(self, signal):
        return self.readings[signal]

    def drive(self, name, velocity):
        self.velocity = velocity

    def push(self, name, force):
        self.force = force

    def brake(self, name):
        self.velocity = self.force = None


TRAVEL = 5e-3
LEVER = TRAVEL / math.tau


def answered(emulated, frames, now):
    """Send frames to an emulated device, and return its answers."""
    for frame in frames:
        emulated.receive(frame, now)
    return emulated.emit(now)


@given(
    velocity=st.floats(-5.0, 5.0, width=32),
    limit=st.floats(0.0, 1.0, width=32),
    watchdog=st.floats(0.0, 1.0, width=32),
)
def test_the_library_of_mjbots_makes_the_frames_of_the_driver(velocity, limit, watchdog):
    theirs = pytest.importorskip("moteus").Controller(id=2)
    made = theirs.make_position(
        position=math.nan, velocity=velocity, maximum_torque=limit, watchdog_timeout=watchdog
    )
    ours = moteus.velocity(velocity, limit, watchdog)
    assert ours[:1] == made.data[:1]
    assert values_of(ours) == pytest.approx(values_of(made.data), nan_ok=True)


def values_of(data: bytes) -> dict[int, float]:
    """Registers that a frame writes, as the emulated controller reads them."""
    emulated = EmulatedMoteus("slave", moteus_settings(), Shaft())
    found = {0x25: math.nan}
    for _, register, values in emulated._subframes(bytes(data)):
        for i, value in enumerate(values or ()):
            found[register + i] = value
    return {number: value for number, value in found.items() if number not in UNUSED}


UNUSED = (0x22, 0x23, 0x24, 0x26, 0x28, 0x29)
"""Registers of a command that one side may leave at their defaults."""


def moteus_settings() -> MoteusSettings:
    return MoteusSettings(
        kind="moteus",
        bus="can",
        node=2,
        mode="velocity",
        travel_mm_per_turn=TRAVEL * 1e3,
        max_velocity_mm_per_s=50.0,
        max_torque_nm=0.5,
        watchdog_ms=50.0,
    )


def test_the_library_of_mjbots_commands_the_emulated_controller():
    library = pytest.importorskip("moteus")
    shaft = Shaft()
    emulated = EmulatedMoteus("slave", moteus_settings(), shaft)
    theirs, now = library.Controller(id=2), 1.0

    def ask(command):
        nonlocal now
        now += 1e-3
        identifier = (0x8000 if command.reply_required else 0) | 2
        frame = can.Message(
            arbitration_id=identifier, is_extended_id=True, is_fd=True, data=command.data
        )
        (answer,) = answered(emulated, [frame], now)
        return library.protocol.parse_message(answer).values

    register = library.Register
    stopped = ask(theirs.make_stop(query=True))
    assert stopped[register.MODE] == library.Mode.STOPPED
    assert stopped[register.POSITION] == pytest.approx(0.01 / TRAVEL, abs=1e-4)
    for _ in range(10):
        moving = ask(
            theirs.make_position(
                position=math.nan,
                velocity=4.0,
                maximum_torque=0.5,
                watchdog_timeout=0.05,
                query=True,
            )
        )
    assert moving[register.MODE] == library.Mode.POSITION
    assert moving[register.FAULT] == 0
    assert shaft.velocity == pytest.approx(4.0 * TRAVEL)
    now += 0.06  # longer than the watchdog
    late = ask(theirs.make_query())
    assert late[register.MODE] == library.Mode.TIMEOUT
    assert shaft.velocity is None


def damiao_settings(mode="impedance") -> MitMotorSettings:
    return MitMotorSettings.model_validate(
        {
            "kind": "mit_motor",
            "bus": "can",
            "model": "DM4310",
            "mode": mode,
            "can_id": 3,
            "reply_id": 0x13,
            "travel_mm_per_turn": TRAVEL * 1e3,
            "watchdog_ms": 20,
        }
    )


def test_a_library_for_damiao_motors_commands_the_emulated_motor_and_reads_its_registers():
    library = pytest.importorskip("damiao_motor.core.motor")
    shaft = Shaft(position=0.3 * LEVER, velocity=2.0 * LEVER)
    emulated = EmulatedMitMotor("m", damiao_settings(), shaft)
    now = 1.0

    class Bus:
        """The bus of the library, on which only the emulated motor answers."""

        def send(self, frame):
            nonlocal now
            now += 1e-3
            for answer in answered(emulated, [frame], now):
                motor.process_feedback_frame(bytes(answer.data), answer.arbitration_id)

    motor = library.DaMiaoMotor(3, 0x13, Bus(), motor_type="4310")
    for register, expected in ((21, 12.5), (22, 30.0), (23, 10.0), (10, 1), (9, 400)):
        motor.request_register_reading(register)
        assert motor.registers[register] == pytest.approx(expected)
    motor.send_raw(motor.encode_enable_msg())
    motor.send_raw(motor.encode_cmd_msg(0.0, 0.0, 1.5, 0.0, 0.0))
    motor.send_raw(motor.encode_cmd_msg(0.0, 0.0, 1.5, 0.0, 0.0))
    assert motor.state["status_code"] == library.DM_MOTOR_ENABLED
    assert motor.state["can_id"] == 3
    assert motor.state["pos"] == pytest.approx(0.3, abs=25.0 / 65535)
    assert motor.state["vel"] == pytest.approx(2.0, abs=60.0 / 4095)
    assert motor.state["torq"] == pytest.approx(1.5, abs=20.0 / 4095)
    assert shaft.force == pytest.approx(1.5 / LEVER, rel=0.01)
    motor.send_raw(motor.encode_disable_msg())
    assert motor.state["status_code"] == library.DM_MOTOR_DISABLED
    assert shaft.force is None


RANGES = mit_motor.DAMIAO["DM4310"]


def test_the_ranges_of_damiao_motors_are_those_of_the_library():
    library = pytest.importorskip("damiao_motor.core.motor")
    theirs = {f"DM{name}": tuple(values) for name, values in library._MOTOR_LIMIT_PARAM}
    ours = {name: tuple(ranges) for name, ranges in mit_motor.DAMIAO.items()}
    assert ours.items() <= theirs.items()


@given(
    st.floats(-12.5, 12.5),
    st.floats(-30.0, 30.0),
    st.floats(0.0, 500.0),
    st.floats(0.0, 5.0),
    st.floats(-10.0, 10.0),
)
def test_a_library_for_damiao_motors_packs_commands_as_the_driver(p, v, kp, kd, torque):
    library = pytest.importorskip("damiao_motor.core.motor")
    motor = library.DaMiaoMotor(3, 0x13, None, motor_type="4310")
    theirs = fields(motor.encode_cmd_msg(p, v, torque, kp, kd))
    ours = fields(mit_motor.command(RANGES, p, v, kp, kd, torque))
    # the library truncates, and the driver rounds
    assert all(0 <= b - a <= 1 for a, b in zip(theirs, ours, strict=True)), (theirs, ours)


def fields(data: bytes) -> list[int]:
    """The five numbers of a command: position, velocity, stiffness, damping and torque."""
    bits = int.from_bytes(data, "big")
    return [bits >> 48, *(bits >> shift & 0xFFF for shift in (36, 24, 12, 0))]
