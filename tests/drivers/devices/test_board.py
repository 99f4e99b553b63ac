"""The driver with both boards, the emulated one and the firmware in C, in virtual time.

Both boards are tested against docs/serial-protocol.md.
"""

from __future__ import annotations

import ctypes
import random
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import pytest
from pydantic import ValidationError

from drivers import RigError
from drivers.codecs import board as codec
from drivers.device import NO_SAMPLE, ForceDrive, VelocityDrive
from drivers.devices.board import Board
from drivers.devices.board_settings import BoardSettings
from drivers.framing import cobs
from sim_backend.wire.devices.board import EmulatedBoard
from sim_backend.wire.emulated_device import Mount

WATCHDOG = "watchdog: no command arrived in time: the loop was late, or the line is disturbed"
ROOT = Path(__file__).parents[3]
FIRMWARE = ROOT / "drivers" / "firmware"
EXAMPLE = {
    name: bytes.fromhex(frame)
    for name, frame in re.findall(
        r"^    ([A-Z]+) +((?:[0-9a-f]{2} ?)+)$",
        (ROOT / "docs" / "serial-protocol.md").read_text(),
        re.MULTILINE,
    )
}
TICK = 1e-3
FULL = {
    "force_n_per_count": (1e-3, 2e-3),
    "position_um_per_count": (1.0, 2.0),
    "velocity_um_per_s_per_count": (1.0, 1.0),
    "analogue_mv_per_count": (1.0, 1.0, 1.0, 1.0),
}


def settings(**changed) -> BoardSettings:
    return BoardSettings(kind="board", bus="usb", **(FULL | changed))


class Bench(Mount):
    """Mount of the board: its signals, and the velocity of each axis [m/s], None if braked."""

    def __init__(self):
        self.senses: dict[str, float] = {}
        self.axes: dict[str, float | None] = {}
        self.driven: set[str] = set()
        """Axes that have been in operation."""

    def sense(self, signal):
        return self.senses.get(signal, 0.0)

    def drive(self, name, velocity):
        self.axes[name] = velocity
        self.driven.add(name)

    def push(self, name, force):
        self.axes[name] = force
        self.driven.add(name)

    def brake(self, name):
        self.axes[name] = None


class Identification(ctypes.Structure):
    _fields_ = [
        ("firmware", ctypes.c_uint8 * 2),
        ("boot", ctypes.c_uint32),
        ("forces", ctypes.c_uint8),
        ("encoders", ctypes.c_uint8),
        ("axes", ctypes.c_uint8),
        ("analogues", ctypes.c_uint8),
        ("max_sample_rate_hz", ctypes.c_uint16),
        ("force_axes", ctypes.c_uint8),
    ]


class Inputs(ctypes.Structure):
    _fields_ = [
        ("time_us", ctypes.c_uint32),
        ("force", ctypes.c_int32 * 2),
        ("position", ctypes.c_int32 * 2),
        ("velocity", ctypes.c_int32 * 2),
        ("analogue", ctypes.c_int32 * 4),
        ("emergency_stop", ctypes.c_bool),
        ("drive_fault", ctypes.c_bool),
    ]


class FirmwareState(ctypes.Structure):
    _fields_ = [
        ("enabled", ctypes.c_bool * 2),
        ("velocity", ctypes.c_int32 * 2),
        ("force", ctypes.c_int32 * 2),
        ("rest", ctypes.c_uint64 * 64),
    ]


class FirmwareBoard:
    """The firmware in C with the interface of an emulated device."""

    version = 1

    def __init__(self, library, settings, mount):
        self.library = library
        self.settings = settings
        self.mount = mount
        self.boot = 0x1234ABCC
        self.emergency_stop = self.drive_fault = False
        self.state = FirmwareState()
        self.reset(0.0)

    def reset(self, now):
        self.boot += 1
        self.started = now
        s = self.settings
        numbers = [len(getattr(s, key)) for key in FULL]
        numbers[2] = s.axes
        forces = sum(1 << i for i, scale in enumerate(s.axis_force_n_per_count) if scale)
        identification = Identification((1, 0), self.boot, *numbers, 4000, forces)
        self.library.teleop_board_init(ctypes.byref(self.state), ctypes.byref(identification))
        self._move()

    def receive(self, data, now):
        for byte in data:
            self.library.teleop_board_receive(ctypes.byref(self.state), byte, self._micros(now))
        self._move()

    def emit(self, now):
        inputs = Inputs(time_us=self._micros(now))
        inputs.emergency_stop, inputs.drive_fault = self.emergency_stop, self.drive_fault
        s = self.settings
        for name, unit, key in (
            ("force", 1.0, "force_n_per_count"),
            ("position", 1e-6, "position_um_per_count"),
            ("velocity", 1e-6, "velocity_um_per_s_per_count"),
            ("analogue", 1e-3, "analogue_mv_per_count"),
        ):
            for i, scale in enumerate(getattr(s, key)):
                getattr(inputs, name)[i] = round(self.mount.sense(f"{name}_{i}") / (scale * unit))
        frames = []
        buffer = (ctypes.c_uint8 * 64)()
        while length := self.library.teleop_board_poll(
            ctypes.byref(self.state), ctypes.byref(inputs), self._micros(now), buffer
        ):
            frames.append(bytes(buffer[:length]))
        self._move()
        return frames

    def _micros(self, now):
        return ctypes.c_uint32(round((now - self.started) * 1e6) & 0xFFFFFFFF)

    def _move(self):
        for i in range(self.settings.axes):
            if self.state.enabled[i] and (scale := self.settings.force_scale(i)):
                self.mount.push(f"axis_{i}", self.state.force[i] * scale)
            elif self.state.enabled[i]:
                self.mount.drive(f"axis_{i}", self.state.velocity[i] * 1e-6)
            else:
                self.mount.brake(f"axis_{i}")


@pytest.fixture(scope="session")
def library(tmp_path_factory):
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not compiler:
        pytest.skip("no C compiler")
    shared = tmp_path_factory.mktemp("firmware") / "libteleop_board.so"
    flags = ["-std=c99", "-O1", "-shared", "-fPIC", "-o", str(shared)]
    subprocess.run([compiler, *flags, str(FIRMWARE / "teleop_board.c")], check=True)
    loaded = ctypes.CDLL(str(shared))
    loaded.teleop_board_poll.restype = ctypes.c_size_t
    return loaded


class Wire:
    """A port that connects the driver and a board in virtual time."""

    port = "here"

    def __init__(self, driver, board):
        self.driver = driver
        self.board = board
        self.time = 0.0
        self.received = 0
        self.sent: list[bytes] = []
        self.deaf = False

    def write(self, data):
        self.sent.append(data)
        if not self.deaf:
            self.board.receive(data, self.time)

    def step(self, alter=lambda frames: frames):
        """Run a tick: the board sends, the driver reads."""
        self.time += TICK
        data = b"".join(alter(self.board.emit(self.time)))
        if data:
            self.received += len(data)
            self.driver.receive(data, self.time - 0.5 * TICK)
        self.driver.update(self.time)

    def wait_for(self, condition, seconds):
        end = self.time + seconds
        while not condition():
            if self.time > end:
                return False
            self.step()
        return True

    def run(self, ticks=5):
        """Run ticks with an unchanged command."""
        for _ in range(ticks):
            self.step()
            self.driver.transmit()

    def enable(self, *names, ticks=10):
        for _ in range(ticks):
            self.step()
            ready = [self.driver.drives[name].enable() for name in names]
            self.driver.transmit()
            if all(ready):
                return True
        return False


@pytest.fixture
def bench():
    return Bench()


@pytest.fixture(params=["emulated", "firmware"])
def make(request, bench):
    """Return a function that makes a wire with a driver and a board of the tested kind."""

    def made(driver_settings=None, board_settings=None):
        driver_settings = driver_settings or settings()
        board_settings = board_settings or driver_settings
        if request.param == "emulated":
            board = EmulatedBoard("board", board_settings, bench)
        else:
            board = FirmwareBoard(request.getfixturevalue("library"), board_settings, bench)
        return Wire(Board("board", driver_settings), board)

    return made


@pytest.fixture
def wire(make):
    wire = make()
    wire.driver.start(wire)
    return wire


def feed(wire, name):
    wire.board.receive(EXAMPLE[name], wire.time)


# ---- what is said ----


def test_the_message_sequence_is_that_of_the_documentation(make, bench):
    # velocity and position scales of the example: one micrometre a count
    wire = make(settings(position_um_per_count=(1.0, 1.0), force_n_per_count=(1e-3, 1e-3)))
    wire.board.boot = 0x1234ABCC
    wire.board.reset(0.0)
    bench.senses = {
        "force_0": 1.0,
        "force_1": -1.0,
        "position_0": 0.025,
        "position_1": -0.03,
        "velocity_1": -0.005,
        "analogue_0": 1.024,
    }
    board = wire.board
    board.receive(EXAMPLE["HELLO"], 0.001)
    assert board.emit(0.001) == [EXAMPLE["IDENTITY"]]
    board.receive(EXAMPLE["CONFIGURE"], 0.002)
    configured, _ = board.emit(0.002)
    assert configured == EXAMPLE["CONFIGURED"]
    board.receive(EXAMPLE["ENABLE"] + EXAMPLE["COMMAND"], 0.002)
    assert bench.axes == {"axis_0": None, "axis_1": -0.005}
    assert board.emit(0.003) == [EXAMPLE["SAMPLE"]]
    board.receive(EXAMPLE["DISABLE"], 0.003)
    assert bench.axes == {"axis_0": None, "axis_1": None}


def test_start_finds_the_board_and_sets_it_up(wire):
    assert wire.driver.identity.firmware == (1, 0)
    assert wire.driver.identity.boot == wire.board.boot
    assert not wire.driver.error


def test_a_board_announces_itself_and_is_silent_until_it_is_configured(make):
    wire = make()
    first = wire.board.emit(0.001)
    assert [type(m) for m in codec.MessageReader().feed(b"".join(first))] == [codec.Identity]
    assert [wire.board.emit(0.001 * i) for i in range(2, 50)] == [[]] * 48


def test_a_silent_port_is_refused_in_one_line(make):
    wire = make()
    wire.deaf = True
    wire.board.emit(0.0)
    with pytest.raises(RigError) as refused:
        wire.driver.start(wire)
    assert str(refused.value) == (
        "board: board on here: no answer in 4 s: expected a board with running firmware"
    )


def test_the_error_for_a_wrong_baud_rate_has_the_number_of_received_bytes(make):
    wire = make()
    wire.deaf = True
    wire.board.emit = lambda now: [random.Random(now).randbytes(40)]
    with pytest.raises(RigError, match="check the baud rate$"):
        wire.driver.start(wire)


@pytest.mark.parametrize("key", list(FULL))
def test_a_board_with_fewer_channels_than_the_rig_file_is_refused(make, key):
    wire = make(settings(), settings(**{key: FULL[key][:1]}))
    with pytest.raises(RigError) as refused:
        wire.driver.start(wire)
    wanted = len(FULL[key])
    assert str(refused.value).endswith(f"{key} has {wanted} entries, expected at most 1")
    assert "\n" not in str(refused.value)


def test_a_rate_that_the_board_cannot_do_is_refused(make):
    wire = make()
    wire.driver.settings = settings().model_copy(update={"sample_rate_hz": 9000})
    with pytest.raises(RigError, match="the board can do 50 ms and 4000 Hz"):
        wire.driver.start(wire)


@pytest.mark.parametrize("rate", [50, 333, 1000])
def test_samples_come_at_the_rate_that_was_set(make, rate):
    wire = make(settings(sample_rate_hz=rate))
    wire.driver.start(wire)
    wire.step()
    frames = [frame for i in range(1000) for frame in wire.board.emit(wire.time + 1e-3 * i)]
    assert len(frames) == pytest.approx(rate, abs=max(2, 0.01 * rate))


# ---- what is measured ----


def test_signals_are_in_si_units_and_have_one_time(wire, bench):
    bench.senses = {
        "force_0": 1.234,
        "force_1": -2.468,
        "position_0": 0.0123,
        "position_1": -0.0246,
        "velocity_0": 0.1,
        "velocity_1": -0.2,
        "analogue_0": 1.5,
        "analogue_3": -2.5,
    }
    wire.run(20)
    for signal, value in bench.senses.items():
        assert wire.driver.samples[signal].value == pytest.approx(value, rel=1e-9)
    assert wire.driver.samples["analogue_1"].value == 0.0
    times = {sample.time for sample in wire.driver.samples.values()}
    assert len(times) == 1
    assert times.pop() == pytest.approx(wire.time, abs=0.6e-3)


def test_only_what_has_a_scale_is_a_signal_or_a_drive():
    driver = Board("b", BoardSettings(kind="board", bus="usb", analogue_mv_per_count=(0.8,)))
    assert driver.signals() == {"analogue_0": "V"}
    assert driver.samples == {"analogue_0": NO_SAMPLE}
    assert driver.drives == {}


def test_the_clock_of_the_board_wraps_without_a_jump(make):
    wire = make()
    wire.board.started = 0.2 - 2**32 * 1e-6
    wire.driver.start(wire)
    assert wire.enable("axis_1")
    for _ in range(40):
        wire.run(10)
        assert wire.driver.samples["force_0"].time == pytest.approx(wire.time, abs=0.6e-3)
    assert wire.driver._uptime < 2**31
    assert wire.driver.rejected == {}
    assert not wire.driver.error


# ---- what moves ----


def test_an_axis_follows_once_it_is_enabled(wire, bench):
    assert bench.axes == {"axis_0": None, "axis_1": None}
    assert wire.enable("axis_1")
    assert bench.axes == {"axis_0": None, "axis_1": 0.0}
    assert wire.driver.drives["axis_1"].command(0.0123456) == pytest.approx(0.012346)
    wire.driver.drives["axis_0"].command(0.1)
    wire.driver.transmit()
    assert bench.axes == {"axis_0": None, "axis_1": pytest.approx(0.012346)}
    assert wire.enable("axis_0", "axis_1")
    assert bench.axes["axis_1"] == pytest.approx(0.012346)


def test_idle_stops_all_axes_immediately_and_may_be_repeated(wire, bench):
    wire.enable("axis_0", "axis_1")
    wire.driver.drives["axis_1"].command(0.05)
    wire.run(3)
    wire.driver.drives["axis_1"].idle()
    assert bench.axes == {"axis_0": None, "axis_1": None}
    wire.driver.drives["axis_0"].idle()
    wire.run(200)
    assert bench.axes == {"axis_0": None, "axis_1": None}
    assert not wire.driver.error


def test_an_idle_driver_sends_nothing(wire):
    wire.sent.clear()
    wire.run(20)
    assert wire.sent == []


def test_enabled_is_the_report_of_the_board_after_the_request(wire):
    assert wire.enable("axis_1")
    wire.driver.drives["axis_1"].idle()
    assert not wire.driver.drives["axis_1"].enable()
    assert wire.enable("axis_1")


def test_earlier_velocities_are_discarded(wire, bench):
    wire.enable("axis_1")
    wire.driver.drives["axis_1"].command(0.05)
    wire.run(3)
    wire.driver.drives["axis_1"].idle()
    wire.enable("axis_1")
    wire.run(3)
    assert bench.axes["axis_1"] == 0.0


def test_commands_continue_after_the_wrap_of_the_sequence_number(wire, bench):
    wire.driver._sequence = 0xFFF0
    wire.driver._send(codec.HELLO)
    wire.run(2)
    wire.driver.start(wire)
    assert wire.enable("axis_1")
    wire.driver.drives["axis_1"].command(0.01)
    wire.run(70)
    assert bench.axes["axis_1"] == pytest.approx(0.01)
    assert not wire.driver.error


# ---- what stops ----


def test_the_watchdog_stops_the_axes_and_is_latched(wire, bench):
    wire.enable("axis_1")
    wire.driver.drives["axis_1"].command(0.05)
    wire.run(3)
    for _ in range(48):
        wire.step()
    assert bench.axes["axis_1"] == pytest.approx(0.05)
    for _ in range(5):
        wire.step()
    assert bench.axes["axis_1"] is None
    assert wire.driver.error == WATCHDOG
    for _ in range(20):
        wire.driver.drives["axis_1"].enable()
        wire.driver.drives["axis_1"].command(0.05)
        wire.run(1)
        assert bench.axes["axis_1"] is None
    wire.driver.drives["axis_1"].idle()
    wire.run(20)
    assert wire.driver.error == WATCHDOG
    assert wire.enable("axis_1")
    assert not wire.driver.error


def test_a_command_after_the_watchdog_time_has_no_effect(wire, bench):
    wire.enable("axis_1")
    wire.driver.drives["axis_1"].command(0.05)
    wire.time += 0.08
    wire.driver.transmit()
    assert bench.axes["axis_1"] is None


def test_enabling_does_not_reset_the_watchdog(wire, bench):
    wire.enable("axis_1")
    for _ in range(80):
        wire.driver._send(codec.ENABLE, codec.enable(1))
        wire.step()
    assert bench.axes["axis_1"] is None


def test_an_open_emergency_stop_stops_the_axes_and_is_no_error_of_the_board(wire, bench):
    wire.enable("axis_1")
    wire.board.emergency_stop = True
    wire.run(2)
    assert bench.axes["axis_1"] is None
    assert wire.driver.emergency_stop
    assert not wire.driver.error
    wire.board.emergency_stop = False
    wire.run(2)
    assert bench.axes["axis_1"] is None
    assert wire.driver.emergency_stop
    wire.driver.drives["axis_1"].idle()
    wire.run(2)
    assert not wire.driver.emergency_stop
    assert wire.enable("axis_1")


def test_nothing_is_enabled_against_an_open_emergency_stop(wire, bench):
    wire.board.emergency_stop = True
    wire.run(2)
    assert not wire.enable("axis_1")
    assert bench.driven == set()


def test_a_drive_fault_stops_the_axes_and_its_error_is_latched(wire, bench):
    wire.enable("axis_1")
    wire.board.drive_fault = True
    wire.run(2)
    assert bench.axes["axis_1"] is None
    assert wire.driver.error == "drive fault input"
    wire.board.drive_fault = False
    wire.driver.drives["axis_1"].idle()
    wire.run(5)
    assert wire.driver.error == "drive fault input"
    assert wire.enable("axis_1")
    assert not wire.driver.error


def test_a_drive_fault_of_an_idle_board_is_reported_while_it_lasts(wire):
    wire.board.drive_fault = True
    wire.run(2)
    assert wire.driver.error == "drive fault input"
    wire.board.drive_fault = False
    wire.run(2)
    assert not wire.driver.error


@pytest.mark.parametrize("same_boot", [False, True])
def test_a_board_reset_is_an_error_until_the_rig_is_opened_again(wire, bench, same_boot):
    wire.enable("axis_1")
    wire.run(50)
    if same_boot:
        wire.board.boot -= 1
    wire.board.reset(wire.time)
    wire.run(5)
    assert bench.axes["axis_1"] is None
    assert wire.driver.error.startswith("the board was reset, open the rig again: ")
    wire.driver.drives["axis_1"].idle()
    assert not wire.enable("axis_1")
    assert wire.driver.error.startswith("the board was reset")


def test_a_reset_is_detected_also_if_its_message_was_lost(wire):
    wire.enable("axis_1")
    wire.board.reset(wire.time)
    wire.step(lambda frames: [])
    wire.run(3)
    assert wire.driver.error.startswith("the board was reset")


def test_a_decreasing_clock_in_the_stream_is_a_reset():
    board = EmulatedBoard("board", settings(), Bench())
    wire = Wire(Board("board", settings()), board)
    wire.driver.start(wire)
    assert wire.enable("axis_1")
    board.started += 0.05
    wire.run(100)
    assert wire.driver.error == ("the board was reset, open the rig again: its clock decreased")


def test_a_board_stopped_by_another_host_has_left_operation(wire):
    wire.enable("axis_1")
    wire.board.receive(codec.frame(codec.DISABLE, wire.driver._sequence), wire.time)
    wire.driver._sequence += 1
    wire.run(3)
    assert wire.driver.error == "the board left operation by itself"


def test_a_new_host_finds_a_board_that_streams_and_is_enabled(wire, bench):
    wire.enable("axis_1")
    wire.driver.drives["axis_1"].command(0.05)
    wire.run(3)
    successor = Board("board", settings())
    wire.driver = successor
    successor.start(wire)
    assert bench.axes["axis_1"] is None
    wire.run(10)
    assert not successor.error
    assert successor.samples["force_0"] is not NO_SAMPLE


def test_stop_ends_the_samples(wire):
    wire.run(3)
    wire.driver.stop()
    wire.step()
    assert [wire.board.emit(wire.time + 0.001 * i) for i in range(20)] == [[]] * 20


# ---- what goes wrong on the wire ----


def test_lost_repeated_late_and_damaged_samples_are_counted_and_rejected(wire, bench):
    wire.run(5)
    old: list[bytes] = []

    def remember(frames):
        old.extend(frames)
        return frames

    wire.step(remember)
    value = wire.driver.samples["force_0"]
    wire.driver.receive(old[0], wire.time + 0.1)
    assert wire.driver.rejected == {"repeated": 1}
    wire.step(lambda frames: [])
    wire.step(lambda frames: [])
    wire.run(1)
    assert wire.driver.rejected == {"repeated": 1, "lost": 2}
    wire.driver.receive(old[0], wire.time + 0.1)
    assert wire.driver.rejected == {"repeated": 1, "lost": 2, "late": 1}
    wire.step(lambda frames: [frames[0][:-3] + bytes((frames[0][-3] ^ 4 or 1, *frames[0][-2:]))])
    assert wire.driver.rejected["checksum"] + wire.driver.rejected["framing"] == 1
    assert wire.driver.samples["force_0"].time > value.time
    assert not wire.driver.error


def test_a_repeated_or_late_command_is_rejected_and_reported_to_the_host(wire, bench):
    wire.enable("axis_1")
    wire.driver.drives["axis_1"].command(0.01)
    wire.driver.transmit()
    fast = wire.sent[-1]
    wire.driver.drives["axis_1"].command(0.02)
    wire.driver.transmit()
    wire.board.receive(fast, wire.time)
    wire.board.receive(wire.sent[-1], wire.time)
    assert bench.axes["axis_1"] == pytest.approx(0.02)
    wire.run(1)
    assert wire.driver.rejected == {"by the board": 2}


def test_a_repeated_command_does_not_reset_the_watchdog(wire, bench):
    wire.enable("axis_1")
    wire.driver.transmit()
    for _ in range(80):
        wire.board.receive(wire.sent[-1], wire.time)
        wire.step()
    assert bench.axes["axis_1"] is None


def test_the_board_survives_any_bytes(wire, bench):
    random_ = random.Random(11)
    frames = [EXAMPLE[name] for name in ("CONFIGURE", "ENABLE", "COMMAND", "DISABLE")]
    for _ in range(5000):
        data = bytearray(random_.choice(frames) if random_.random() < 0.8 else b"\0")
        for _ in range(random_.randint(1, 4)):
            at = random_.randrange(len(data))
            data[at : at + random_.randint(0, 2)] = random_.randbytes(random_.choice((1, 2, 40)))
        wire.board.receive(bytes(data), wire.time)
        wire.time += 2e-4
        for frame in wire.board.emit(wire.time):
            assert frame.endswith(b"\0")
            assert b"\0" not in frame[:-1]
    wire.board.receive(cobs.DELIMITER, wire.time)
    successor = wire.driver = Board("board", settings())
    successor.start(wire)
    assert wire.enable("axis_1")


def test_the_driver_survives_any_bytes(wire):
    random_ = random.Random(12)
    for _ in range(3000):
        spoil = random_.random() < 0.5

        def alter(frames, spoil=spoil):
            if not spoil or not frames:
                return frames
            data = bytearray(b"".join(frames))
            data[random_.randrange(len(data))] = random_.randrange(256)
            return [bytes(data)]

        wire.step(alter)
    assert wire.driver.rejected.total() > 1000
    wire.step()
    assert wire.driver.samples["force_0"].time == pytest.approx(wire.time, abs=1.2e-3)
    assert not wire.driver.error


def test_a_board_of_another_version_is_refused():
    driver = Board("board", settings())
    board = EmulatedBoard("board", settings(), Bench())
    board.version = 3
    with pytest.raises(RigError) as refused:
        driver.start(Wire(driver, board))
    assert str(refused.value) == (
        "board: board on here: protocol version 3, expected 1 or 2: see docs/serial-protocol.md"
    )


# ---- axes that accept forces ----

PADDLE = settings(axis_force_n_per_count=(0.0, 1e-3))
"""Axis 0 accepts velocities, axis 1 forces."""


def test_an_axis_that_accepts_forces_is_a_force_drive_and_exerts_the_force(make, bench):
    wire = make(PADDLE)
    driver = wire.driver
    driver.start(wire)
    assert driver.identity.version == 2
    assert driver.identity.force_axes == 2
    assert isinstance(driver.drives["axis_0"], VelocityDrive)
    assert isinstance(driver.drives["axis_1"], ForceDrive)
    assert wire.enable("axis_0", "axis_1")
    assert bench.axes == {"axis_0": 0.0, "axis_1": 0.0}
    assert driver.drives["axis_0"].command(0.02) == pytest.approx(0.02)
    assert driver.drives["axis_1"].command(-1.23456) == pytest.approx(-1.235)
    wire.run(2)
    assert bench.axes == pytest.approx({"axis_0": 0.02, "axis_1": -1.235})


def test_without_commands_and_after_a_stop_there_is_no_force(make, bench):
    wire = make(PADDLE)
    wire.driver.start(wire)
    drive = wire.driver.drives["axis_1"]
    assert wire.enable("axis_1")
    drive.command(2.0)
    wire.run(2)
    assert bench.axes["axis_1"] == pytest.approx(2.0)
    for _ in range(60):
        wire.step()
    assert bench.axes["axis_1"] is None
    assert wire.driver.error == WATCHDOG
    assert wire.wait_for(drive.idle, 0.1)
    assert wire.enable("axis_1")
    wire.run(2)
    assert bench.axes["axis_1"] == 0.0
    drive.command(2.0)
    wire.run(2)
    wire.board.emergency_stop = True
    wire.run(2)
    assert bench.axes["axis_1"] is None


@pytest.mark.parametrize(
    ("host", "board", "message"),
    [
        ({}, PADDLE, "axis_1 accepts forces: expected a scale for it in axis_force_n_per_count"),
        (
            {"axis_force_n_per_count": (1e-3, 1e-3)},
            PADDLE,
            "axis_0 accepts velocities: expected 0 or no scale for it in axis_force_n_per_count",
        ),
        (
            {"axis_force_n_per_count": (1e-3,)},
            settings(),
            "axis_0 accepts velocities: expected 0 or no scale for it in axis_force_n_per_count",
        ),
        (
            {"velocity_um_per_s_per_count": (), "axis_force_n_per_count": (1e-3, 1e-3)},
            settings(velocity_um_per_s_per_count=(), axis_force_n_per_count=(1e-3,)),
            "axis_force_n_per_count has 2 entries, expected at most 1",
        ),
    ],
)
def test_a_host_that_asks_for_another_kind_of_axis_is_refused(make, bench, host, board, message):
    wire = make(settings(**host), board)
    with pytest.raises(RigError) as caught:
        wire.driver.start(wire)
    assert str(caught.value) == f"board: board on here: {message}"
    assert not bench.driven


def test_an_axis_without_any_scale_is_refused():
    with pytest.raises(ValidationError, match="axis_1 has no scale: expected one in velocity_um"):
        settings(velocity_um_per_s_per_count=(1.0,), axis_force_n_per_count=(1e-3, 0.0))


def test_a_board_without_such_axes_sends_the_identity_that_earlier_hosts_know(make):
    wire = make(settings(axis_force_n_per_count=(0.0, 0.0)))
    (identity,) = wire.board.emit(0.001)
    body = cobs.CobsReader(64, Counter()).feed(identity)[0]
    assert len(body) == 18 + 2
    assert body[7] == 1
