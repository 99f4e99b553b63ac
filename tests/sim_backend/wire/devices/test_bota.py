from __future__ import annotations

import struct

import pytest

from drivers.devices.bota import BotaSettings
from sim_backend.wire.devices.bota import BACKLOG, FASTEST, EmulatedBota, crc

PERIOD = 1.0 / FASTEST

VECTOR = bytes.fromhex("aa00000000803f0000004000004040cdcccc3dcdcc4c3e9a99993ee80300000000c841dabb")
GREETING = b"App Init\r\n"


LOADS = {"fx": 1.0, "fy": 2.0, "fz": 3.0, "mx": 0.1, "my": 0.2, "mz": 0.3, "temperature": 25.0}


@pytest.fixture
def sensor(bench) -> EmulatedBota:
    return EmulatedBota("tip", BotaSettings(kind="bota", bus="force"), bench)


def test_the_check_sum_is_that_of_the_catalogue():
    assert crc(b"123456789") == 0x906E


def test_sends_a_message_at_power_up_and_then_samples(sensor):
    assert sensor.emit(5.0) == [GREETING]
    assert len(sensor.emit(5.0 + 3.5 * PERIOD)) == 4


def test_a_frame_is_decoded_to_the_reference_values(sensor):
    sensor.emit(5.0)
    sensor._power_up = 5.0 - 1e-3
    assert sensor.emit(5.0 + 0.5 * PERIOD) == [VECTOR]


def test_called_late_it_sends_a_few_frames_of_backlog_with_their_own_time_stamps(sensor):
    sensor.emit(0.0)
    frames = sensor.emit(10.0)
    assert len(frames) == BACKLOG
    stamps = [struct.unpack_from("<I", frame, 27)[0] for frame in frames]
    assert stamps[-1] == pytest.approx(10e6 - PERIOD * 1e6, abs=1)
    assert stamps[1] - stamps[0] == pytest.approx(PERIOD * 1e6, abs=1)


def test_called_twice_at_once_it_sends_nothing_twice(sensor):
    sensor.emit(0.0)
    assert sensor.emit(0.5 * PERIOD)
    assert not sensor.emit(0.5 * PERIOD)


def test_saturates_outside_of_its_range_and_reports_it(sensor, bench):
    bench.loads["fz"] = -1e4
    sensor.emit(0.0)
    (frame,) = sensor.emit(0.5 * PERIOD)
    status, *_, fz = struct.unpack_from("<x H 3f", frame)
    assert (status, fz) == (2, -1200.0)


def test_configuration_mode_is_silent(sensor):
    sensor.emit(0.0)
    sensor.receive(b"C", 0.0)
    assert sensor.emit(1.0) == [b"r,0,C,0\r\n"]
    assert sensor.emit(2.0) == []
    sensor.receive(b"R", 2.0)
    answer, *frames = sensor.emit(2.0 + 1.5 * PERIOD)
    assert answer == b"r,0,R,0\r\n"
    assert len(frames) == 1
