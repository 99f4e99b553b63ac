"""The driver of Dynamixel servos and emulated servos on one line, in virtual time."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from drivers.codecs import dynamixel as codec
from drivers.device import ForceDrive, PositionDrive, VelocityDrive
from drivers.devices.dynamixel import Dynamixel, DynamixelSettings, check_latency
from drivers.rig import RigError
from drivers.transports.shared_line import SharedLine
from drivers.transports.stream_port import StreamPort
from sim_backend.wire.devices.dynamixel import EmulatedDynamixel
from sim_backend.wire.emulated_device import Mount

TICK = 1e-3
LEVER = 0.07
WATCHDOG = 0.06


def settings(**changes):
    values = {
        "kind": "dynamixel",
        "bus": "servos",
        "id": 1,
        "model": "XM430-W350",
        "mode": "current",
        "travel_mm_per_turn": LEVER * 1e3 * math.tau,
        "torque_constant_nm_per_a": 1.7,
        "watchdog_ms": round(WATCHDOG * 1e3),
    }
    return DynamixelSettings.model_validate(values | changes)


class Horn(Mount):
    def __init__(self):
        self.readings = {"position": 0.0, "velocity": 0.0, "force": 0.0}
        self.applied = None

    def sense(self, signal):
        return self.readings[signal]

    def drive(self, name, velocity):
        self.applied = velocity

    push = drive

    def brake(self, name):
        self.applied = None


class Port(StreamPort):
    """A serial port in virtual time."""

    def __init__(self, bench):
        self.bench = bench
        super().__init__("servos", lambda: bench.time, "here", None)
        self.sent = []

    def open(self): ...

    def close(self): ...

    def _read(self):
        data, self.bench.waiting = self.bench.waiting, b""
        return b"" if self.bench.deaf else data

    def _write(self, data):
        self.sent.append(data)
        if not self.bench.severed:
            for servo in self.bench.servos:
                servo.receive(data, self.bench.time)
        return len(data)


class Bench:
    """Drivers and emulated servos on one line."""

    def __init__(self, *sections, other=None):
        sections = sections or (settings(),)
        self.time = 5.0
        self.waiting = b""
        self.severed = self.deaf = False
        self.horns = [Horn() for _ in sections]
        self.devices = [Dynamixel(f"servo{s.id}", s) for s in sections]
        self.servos = [
            EmulatedDynamixel("servo", other or s, horn)
            for s, horn in zip(sections, self.horns, strict=True)
        ]
        self.port = Port(self)
        self.line = SharedLine(self.port)
        self.line.nap = lambda seconds: self.advance()
        for device in self.devices:
            self.line.connect(device)
        self.device, self.servo, self.horn = self.devices[0], self.servos[0], self.horns[0]

    @property
    def drive(self):
        return self.device.drives["axis"]

    def advance(self):
        self.time += TICK
        for servo in self.servos:
            self.waiting += b"".join(servo.emit(self.time))

    def start(self):
        for device in self.devices:
            self.line.start(device)
        return self

    def run(self, ticks, value=None):
        for _ in range(ticks):
            self.advance()
            self.line.poll()
            for device in self.devices:
                device.update(self.time)
                if value is not None:
                    device.drives["axis"].command(value)
                    device.transmit()

    def enable(self, ticks=100):
        for _ in range(ticks):
            ready = [device.drives["axis"].enable() for device in self.devices]
            if all(ready):
                return self
            for device in self.devices:
                device.transmit()
            self.run(1)
        raise AssertionError([device.error for device in self.devices])


def test_a_servo_is_set_up_and_measured():
    bench = Bench()
    bench.servo.table[64] = 1
    bench.horn.readings |= {"position": 0.05, "velocity": -0.1, "force": 3.0}
    bench.start()
    bench.run(20)
    assert bench.servo.table[11] == 0
    assert bench.servo.table[64] == 0
    values = {name: sample.value for name, sample in bench.device.samples.items()}
    assert values["position"] == pytest.approx(0.05, abs=LEVER * math.tau / 8192)
    assert values["velocity"] == pytest.approx(-0.1, abs=1e-3)
    assert values["force"] == pytest.approx(3.0, abs=0.04)
    assert not bench.device.rejected


@pytest.mark.parametrize(
    ("mode", "kind"),
    [("current", ForceDrive), ("velocity", VelocityDrive), ("position", PositionDrive)],
)
def test_the_mode_chooses_what_the_servo_accepts(mode, kind):
    bench = Bench(settings(mode=mode)).start()
    assert isinstance(bench.drive, kind)
    assert bench.servo.table[11] == {"current": 0, "velocity": 1, "position": 4}[mode]


@pytest.mark.parametrize(("mode", "value"), [("current", 4.0), ("velocity", 0.05)])
def test_it_is_enabled_at_rest_and_follows_commands(mode, value):
    bench = Bench(settings(mode=mode)).start()
    while not bench.drive.enable():
        bench.run(1, value)
        assert not bench.horn.applied
    bench.run(5, value)
    assert bench.horn.applied == pytest.approx(value, rel=0.02)
    assert bench.horn.applied == pytest.approx(bench.drive.command(value))


def test_a_position_is_followed_from_the_present_one():
    bench = Bench(settings(mode="position"))
    bench.horn.readings["position"] = 0.2
    bench.start()
    bench.run(5)
    bench.enable()
    assert bench.horn.applied == pytest.approx(0.0, abs=0.01)
    bench.run(10, 0.21)
    assert bench.horn.applied > 0.1


def test_a_force_is_limited_to_the_current_limit():
    bench = Bench()
    bench.servo.table[38:40] = (100).to_bytes(2, "little")
    bench.start().enable()
    newtons = 1.7 * 2.69e-3 / LEVER
    assert bench.drive.command(1e3) == pytest.approx(100 * newtons)


def test_servos_on_one_line_take_turns():
    bench = Bench(settings(id=1), settings(id=2)).start().enable()
    bench.run(30, 2.0)
    for horn, device in zip(bench.horns, bench.devices, strict=True):
        assert horn.applied == pytest.approx(2.0, rel=0.02)
        assert bench.time - device.samples["position"].time < 6 * TICK
        assert not device.rejected


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"model": "XM999"}, "expected one of XL330-M077"),
        ({"torque_constant_nm_per_a": None}, "torque_constant_nm_per_a: missing"),
        ({"watchdog_ms": 50}, "multiple of 20"),
    ],
)
def test_wrong_settings_are_refused(changes, words):
    with pytest.raises(ValidationError, match=words):
        settings(**changes)


def test_another_model_is_refused():
    bench = Bench(other=settings(model="XL330-M288"))
    with pytest.raises(RigError, match="servo1: servo 1 on servos .here.: model number 1200: expe"):
        bench.start()


def test_a_silent_line_is_refused():
    bench = Bench()
    bench.severed = True
    with pytest.raises(RigError, match="no answer, .* rejected for no answer: expected a D"):
        bench.start()


def test_a_slow_adapter_is_refused_with_the_remedy(tmp_path):
    timer = tmp_path / "ttyUSB0" / "device" / "latency_timer"
    timer.parent.mkdir(parents=True)
    timer.write_text("16\n")
    with pytest.raises(RigError, match="latency_timer of ttyUSB0 is 16 ms: expected 1: echo 1 |"):
        check_latency("servo", "/dev/ttyUSB0", tmp_path)
    timer.write_text("1\n")
    check_latency("servo", "/dev/ttyUSB0", tmp_path)
    check_latency("servo", "/dev/ttyACM0", tmp_path)


def test_without_commands_nothing_is_sent_until_the_watchdog_has_acted():
    bench = Bench().start().enable()
    bench.run(5, 2.0)
    bench.port.sent.clear()
    bench.run(round(1.5 * WATCHDOG / TICK))
    assert len(bench.port.sent) <= WATCHDOG / TICK / 2 + 2
    assert bench.horn.applied is None
    bench.run(round(1.0 * WATCHDOG / TICK) + 10)
    assert bench.device.error == "bus watchdog: no command arrived in time"


def test_an_error_is_cleared_by_enabling_again_after_idle():
    bench = Bench().start().enable()
    bench.run(5, 2.0)
    bench.run(200)
    assert bench.device.error
    for _ in range(50):
        if bench.drive.idle():
            break
        bench.run(1)
    bench.enable()
    bench.run(5, 2.0)
    assert bench.horn.applied == pytest.approx(2.0, rel=0.02)


def test_a_hardware_error_is_reported():
    bench = Bench().start().enable()
    bench.run(5, 2.0)
    bench.servo.table[70] = 0x20
    bench.run(200, 2.0)
    assert bench.device.error == "overload"


def test_missing_answers_are_an_error():
    bench = Bench().start().enable()
    bench.run(5, 2.0)
    bench.deaf = True
    bench.run(round(WATCHDOG / TICK) + 5, 2.0)
    assert bench.device.error.startswith("no answer for 6")


def test_a_stop_is_confirmed_by_the_servo_and_requested_ever_more_rarely():
    bench = Bench().start().enable()
    bench.run(5, 2.0)
    bench.deaf = True
    assert not bench.drive.idle()
    bench.port.sent.clear()
    times = []
    for _ in range(400):
        bench.run(1)
        assert not bench.drive.idle()
        times += [bench.time] * (len(bench.port.sent) - len(times))
    assert bench.horn.applied is None
    off = codec.silent_write(1, codec.TORQUE_ENABLE, b"\0")
    assert all(data.startswith(off) for data in bench.port.sent)
    assert times[-1] - times[-2] == pytest.approx(2 * WATCHDOG, abs=5 * TICK)
    bench.deaf = False
    bench.run(round(3 * WATCHDOG / TICK))
    assert bench.drive.idle()
