"""The Haply driver with the emulated service, in virtual time."""

from __future__ import annotations

import json

import pytest

from drivers.devices.haply import Haply, HaplySettings
from drivers.rig import RigError
from drivers.transports.stream_port import StreamPort
from sim_backend.wire.devices.haply import EmulatedHaply
from sim_backend.wire.emulated_device import Mount

TICK = 1e-3


class Bench(StreamPort, Mount):
    """The port and the mount of the device; `wait_for` passes the virtual time."""

    def __init__(self, **entries):
        self.time = 1.0
        super().__init__("handle", lambda: self.time, "127.0.0.1:10001", None)
        section = HaplySettings(
            kind="haply",
            bus="handle",
            **{"device_id": "049D", "axis": "y", "max_force_n": 8.0} | entries,
        )
        self.device, self.service = Haply("master", section), EmulatedHaply("", section, self)
        self.attach(self.device.receive)
        self.nap = self.pass_time
        self.pump = self.tick
        self.readings = {"position": 0.01, "velocity": 0.02}
        self.pushed, self.deaf = None, False
        self.sent = 0

    def sense(self, signal):
        return self.readings[signal]

    def drive(self, name, velocity):
        raise AssertionError

    def push(self, name, force):
        self.pushed = force

    def brake(self, name):
        self.pushed = None

    def open(self): ...

    def close(self): ...

    def pass_time(self, seconds):
        self.time += seconds

    def _read(self):
        data = b"".join(self.service.emit(self.time))
        return b"" if self.deaf else data

    def _write(self, data):
        self.sent += 1
        self.service.receive(data, self.time)
        return len(data)

    def tick(self):
        self.time += TICK
        self.poll()
        self.device.update(self.time)

    def start(self):
        self.device.start(self)
        return self

    def operate(self, force, ticks=10):
        for _ in range(ticks):
            self.tick()
            ready = self.device.enable()
            self.device.command(force if ready else 0.0)
            self.device.transmit()
        return ready

    def refusal(self):
        with pytest.raises(RigError) as refused:
            self.start()
        assert "\n" not in str(refused.value)
        return str(refused.value)


def test_its_signals_are_measured_at_each_tick_without_force():
    bench = Bench().start()
    bench.sent = 0
    for _ in range(10):
        bench.tick()
    values = {signal: sample.value for signal, sample in bench.device.samples.items()}
    assert values == {"position": 0.01, "velocity": 0.02}
    assert bench.time - bench.device.samples["position"].time < 2 * TICK
    assert bench.sent == 10
    assert bench.pushed is None
    assert not bench.device.rejected


def test_a_force_acts_along_its_axis_only_and_is_limited():
    bench = Bench().start()
    assert bench.operate(-3.0)
    assert bench.pushed == -3.0
    assert bench.service.force == {"x": 0.0, "y": -3.0, "z": 0.0}
    assert bench.device.command(99.0) == 8.0
    assert not bench.device.error


def test_without_commands_no_answer_is_missing():
    bench = Bench().start()
    assert bench.operate(2.0)
    for _ in range(300):
        bench.tick()
    assert bench.device.error == ""
    assert bench.pushed is None  # the service has returned the device to idle
    assert bench.operate(2.0)


def test_a_stop_is_confirmed_by_the_answer_to_a_message_without_force():
    bench = Bench().start()
    assert bench.operate(2.0)
    bench.deaf = True
    assert not any((bench.device.idle(), bench.tick())[0] for _ in range(20))
    assert bench.pushed is None
    bench.deaf = False
    bench = Bench().start()
    assert bench.operate(2.0)
    assert not bench.device.idle()
    bench.tick()
    assert bench.device.idle()
    assert bench.device.command(1.0) == 0.0
    assert bench.operate(1.0)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (lambda b: setattr(b, "deaf", True), "no answer for 51 ms"),
        (lambda b: b.service.status.update(power_supply=False), "not power_supply"),
        (lambda b: b.device.receive(b"\x88\x02\x03\xe8", b.time), "the service has closed"),
        (lambda b: b.device.receive(b"\xf1\x00", b.time), "malformed WebSocket frame"),
    ],
)
def test_a_problem_in_operation_is_an_error(change, error):
    bench = Bench().start()
    assert bench.operate(2.0)
    change(bench)
    bench.operate(2.0, 60)
    assert bench.device.error.startswith(error)
    assert bench.device.command(2.0) == 0.0


@pytest.mark.parametrize(
    ("entries", "change", "message"),
    [
        ({}, lambda b: setattr(b, "deaf", True), "no list of devices in 2 s: expected the Haply"),
        ({"model": "minverse"}, lambda b: None, "type 'inverse3', expected 'minverse'"),
        ({}, lambda b: b.service.status.update(calibrated=False), "not calibrated: expected"),
    ],
)
def test_a_service_or_device_that_does_not_fit_is_refused(entries, change, message):
    bench = Bench(**entries)
    change(bench)
    assert message in bench.refusal()


def test_another_device_is_named():
    bench = Bench()
    bench.service.settings = bench.service.settings.model_copy(update={"device_id": "04EA"})
    assert "049D on handle (127.0.0.1:10001): the service has the Inverse3 devices 04EA" in (
        bench.refusal()
    )


@pytest.mark.parametrize("message", [b"{", b"[]", b'{"inverse3": [{"device_id": "049D"}]}'])
def test_malformed_messages_are_counted(message):
    bench = Bench().start()
    bench.device.receive(bytes([0x81, len(message)]) + message, bench.time)
    assert bench.device.rejected["malformed"] == 1
    assert not bench.device.error


def test_a_message_in_parts_and_a_ping_are_processed():
    bench = Bench().start()
    state = {"cursor_position": {"y": 0.5}, "cursor_velocity": {"y": 0.0}}
    message = json.dumps({"inverse3": [{"device_id": "049D", "state": state}]}).encode()
    first, second = message[:50], message[50:]
    frames = bytes([0x01, 50]) + first + b"\x89\x00" + bytes([0x80, len(second)]) + second
    for byte in frames:
        bench.device.receive(bytes([byte]), bench.time)
    assert bench.device.samples["position"].value == 0.5
