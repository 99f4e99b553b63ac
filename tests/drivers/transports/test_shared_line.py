"""Several devices on one serial line: their turns, lost answers, and the line on a terminal."""

from __future__ import annotations

import threading
import time
from collections import Counter

import pytest

from drivers.device import LineFrames, LineRequest
from drivers.rig import RigError
from drivers.transports.serial_port import SerialPort
from drivers.transports.shared_line import SharedLine
from drivers.transports.stream_port import StreamPort
from sim_backend.wire.emulated_device import Mount
from sim_backend.wire.serial_wire import SerialWire

from ..shared_line_devices import EmulatedMeter, Meter, MeterSettings

TICK = 1e-3


class Stream(StreamPort):
    """A port in virtual time; a test gives the received bytes."""

    def __init__(self):
        self.time = 1.0
        super().__init__("line", lambda: self.time, "/dev/ttyUSB0", 100_000)
        self.sent = []
        self.incoming = b""

    def open(self): ...

    def close(self): ...

    def _read(self):
        data, self.incoming = self.incoming, b""
        return data

    def _write(self, data):
        self.sent.append((self.time, data))
        return len(data)


class Node:
    """A device whose frames are two bytes: its address and a value."""

    name = "node"

    def __init__(self, address, is_answered=True):
        self.address = address
        self.is_answered = is_answered
        self.rejected = Counter()
        self.received = []
        self.requests = 1_000_000

    @staticmethod
    def split(data):
        pairs = [data[i : i + 2] for i in range(0, len(data) - 1, 2)]
        good = [(pair[0], pair) for pair in pairs if pair[1] != 0xFF]
        bad = len(pairs) - len(good)
        return LineFrames(good, {"checksum": bad} if bad else {}, data[2 * len(pairs) :])

    def start(self, line): ...

    def request(self, now):
        self.requests -= 1
        if self.requests < 0:
            return None
        return LineRequest(bytes([self.address]), 5e-3, self.is_answered)

    def receive(self, frame, now):
        self.received.append(frame[1])


@pytest.fixture
def stream():
    return Stream()


def started(stream, *nodes):
    line = SharedLine(stream)
    line.open()
    for node in nodes:
        line.connect(node)
    for node in nodes:
        line.start(node)
    return line


def tick(line, stream, incoming=b""):
    stream.time += TICK
    stream.incoming += incoming
    before = len(stream.sent)
    line.poll()
    return [data for _, data in stream.sent[before:]]


def test_one_request_is_on_the_line_and_the_next_follows_the_answer_in_the_same_tick(stream):
    a, b = Node(1), Node(2)
    line = started(stream, a, b)
    assert tick(line, stream) == [b"\1"]
    assert tick(line, stream) == []
    assert tick(line, stream, b"\1\x10") == [b"\2"]
    assert tick(line, stream, b"\2\x20") == [b"\1"]
    assert (a.received, b.received) == ([0x10], [0x20])
    assert not a.rejected
    assert not b.rejected


def test_an_answer_in_pieces_is_one_frame(stream):
    a, b = Node(1), Node(2)
    line = started(stream, a, b)
    tick(line, stream)
    assert tick(line, stream, b"\1") == []
    assert tick(line, stream, b"\x10") == [b"\2"]
    assert a.received == [0x10]


def test_after_the_time_of_a_request_the_next_device_has_its_turn(stream):
    a, b = Node(1), Node(2)
    line = started(stream, a, b)
    tick(line, stream)
    sent = [tick(line, stream, b"\1" if n == 3 else b"") for n in range(6)]
    # 5 ms after the end of the request, which takes 0.1 ms
    assert sent == [[], [], [], [], [], [b"\2"]]
    assert a.rejected == {"no answer": 1}
    tick(line, stream, b"\2\x20")
    assert b.received == [0x20]  # the first byte of the lost answer is discarded


def test_a_late_answer_reaches_its_device_and_does_not_end_the_turn_of_another(stream):
    a, b = Node(1), Node(2)
    line = started(stream, a, b)
    for _ in range(7):
        tick(line, stream)
    assert tick(line, stream, b"\1\x10") == []
    assert a.received == [0x10]
    assert tick(line, stream, b"\2\x20") == [b"\1"]


def test_a_device_without_a_request_leaves_its_turn_to_the_next(stream):
    a, b = Node(1), Node(2)
    a.requests = 1
    line = started(stream, a, b)
    tick(line, stream)
    assert tick(line, stream, b"\1\x10") == [b"\2"]
    assert tick(line, stream, b"\2\x20") == [b"\2"]
    b.requests = 0
    assert tick(line, stream, b"\2\x20") == []


def test_after_a_request_without_an_answer_the_line_is_quiet_for_its_time(stream):
    a, b = Node(1, is_answered=False), Node(2)
    line = started(stream, a, b)
    sent = [tick(line, stream) for _ in range(7)]
    assert sent == [[b"\1"], [], [], [], [], [], [b"\2"]]
    assert not a.rejected


def test_malformed_frames_and_unknown_addresses_count_for_the_device_that_was_asked(stream):
    a, b = Node(1), Node(2)
    line = started(stream, a, b)
    tick(line, stream)
    tick(line, stream, b"\1\xff\7\x33")
    assert a.rejected == {"checksum": 1, "unknown address": 1}
    assert not b.rejected


def test_devices_that_are_not_started_are_not_asked_and_all_start_anew_after_an_opening(stream):
    a, b = Node(1), Node(2)
    line = SharedLine(stream)
    line.open()
    line.connect(a)
    line.connect(b)
    line.start(b)
    assert tick(line, stream) == [b"\2"]
    line.open()
    assert tick(line, stream, b"\2\x20") == []
    assert b.received == []


class Bench(Mount):
    def sense(self, signal):
        return 1.23

    def drive(self, name, velocity): ...

    def brake(self, name): ...


@pytest.fixture
def terminal(tmp_path):
    """Three emulated meters on a pseudo-terminal, served by a thread, and the host's line."""
    pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
    sections = [MeterSettings(kind="meter", bus="line", address=n) for n in (1, 2, 7)]
    meters = [EmulatedMeter(f"m{s.address}", s, Bench()) for s in sections]
    wire = SerialWire(tmp_path / "line", meters, 115_200)
    wire.open()
    done = threading.Event()

    def serve():
        while not done.wait(0.2e-3):
            wire.serve(time.monotonic())

    thread = threading.Thread(target=serve)
    thread.start()
    line = SharedLine(SerialPort("line", time.monotonic, str(tmp_path / "line"), 115_200))
    line.open()
    drivers = [Meter(f"m{s.address}", s) for s in sections]
    for driver in drivers:
        line.connect(driver)
    yield line, drivers, meters
    line.close()
    done.set()
    thread.join()
    wire.close()


@pytest.mark.real_time
def test_three_devices_on_a_terminal_answer_in_turn(terminal):
    line, drivers, meters = terminal
    for driver in drivers:
        line.start(driver)
    assert [driver.samples["force"].value for driver in drivers] == pytest.approx([1.23] * 3)
    assert not any(driver.rejected for driver in drivers)
    assert len({meter.heard for meter in meters}) == 1  # each hears all requests
    for driver in drivers:
        driver.samples.clear()
    assert line.wait_for(lambda: all(driver.samples for driver in drivers), 5.0)


@pytest.mark.real_time
def test_a_device_that_is_silent_is_named_and_the_others_answer(terminal):
    line, drivers, meters = terminal
    meters[1].silent = True
    line.start(drivers[0])
    with pytest.raises(RigError, match=r"m2: no answer on line \(.*line\): expected a meter"):
        line.start(drivers[1])
    line.start(drivers[2])
    assert drivers[1].rejected["no answer"] > 3
    assert drivers[2].samples["force"].value == pytest.approx(1.23)
