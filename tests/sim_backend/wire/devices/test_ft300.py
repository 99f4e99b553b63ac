from __future__ import annotations

import pytest

from drivers.devices.ft300 import Ft300Settings
from sim_backend.wire.devices.ft300 import BACKLOG, PERIOD, EmulatedFt300, crc

VECTOR = bytes.fromhex("204e640038ff2c010a00ecff1e00c826")
REQUEST = bytes.fromhex("09 10 01 9A 00 01 02 02 00 CD CA")


LOADS = {"fx": 1.0, "fy": -2.0, "fz": 3.0, "mx": 0.01, "my": -0.02, "mz": 0.03}


@pytest.fixture
def sensor(bench) -> EmulatedFt300:
    return EmulatedFt300("tip", Ft300Settings(kind="ft300", bus="force"), bench)


def test_the_check_sum_is_that_of_the_catalogue():
    assert crc(b"123456789") == 0x4B37


def test_is_silent_until_asked(sensor):
    assert sensor.emit(10.0) == []


def test_answers_the_request_and_then_streams_the_vector(sensor):
    for byte in b"\x00" + REQUEST:
        sensor.receive(bytes((byte,)), 0.0)
    assert sensor.emit(0.0) == [bytes.fromhex("09 10 01 9A 00 01 21 52")]
    assert sensor.emit(1.5 * PERIOD) == [VECTOR]


def test_a_corrupted_request_is_not_answered(sensor):
    sensor.receive(REQUEST[:-1] + b"\x00", 0.0)
    assert sensor.emit(1.0) == []


def test_called_late_it_sends_a_few_frames_of_backlog(sensor):
    sensor.receive(REQUEST, 0.0)
    sensor.emit(0.0)
    assert sensor.emit(10.0) == [VECTOR] * BACKLOG
    assert sensor.emit(10.0) == []


def test_bytes_of_ff_interrupt_the_stream(sensor):
    sensor.receive(REQUEST, 0.0)
    sensor.receive(b"\xff" * 50, 0.0)
    sensor.emit(0.0)
    assert sensor.emit(1.0) == []


def test_saturates_without_a_report(sensor, bench):
    bench.loads["fz"] = 1e4
    sensor.receive(REQUEST, 0.0)
    frames = sensor.emit(1.5 * PERIOD)
    assert int.from_bytes(frames[-1][6:8], "little", signed=True) == 30000
