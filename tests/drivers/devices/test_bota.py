from __future__ import annotations

import struct

import pytest

from drivers.devices.bota import Bota, BotaSettings
from drivers.rig import RigError
from sim_backend.wire.devices.bota import FASTEST, EmulatedBota

PERIOD = 1.0 / FASTEST

SETTINGS = BotaSettings(kind="bota", bus="force")
TICK = 1e-3


LOADS = {"fx": 1.0, "fy": 2.0, "fz": 3.0, "mx": 0.1, "my": 0.2, "mz": 0.3, "temperature": 25.0}


@pytest.fixture
def bench(sensor_bench):
    return sensor_bench(Bota, EmulatedBota, SETTINGS, LOADS, "/dev/ttyUSB0", 460800)


@pytest.fixture
def started(bench):
    bench.device.start(bench)
    return bench


def test_measures_the_values_of_the_sensor(started):
    started.run(5e-3)
    values = {signal: sample.value for signal, sample in started.device.samples.items()}
    assert values == pytest.approx(started.loads)
    assert started.device.signals().keys() == values.keys()


def test_bytes_before_the_first_frame_are_not_counted_as_lost(started):
    assert not started.device.rejected


def test_samples_are_as_old_as_they_were_taken(started):
    for _ in range(200):
        started.run()
        age = started.time - started.device.samples["fz"].time
        assert 0.0 < age < PERIOD + 2 * TICK


def test_of_a_burst_the_newest_frame_is_used_and_times_stay_one_period_apart(started):
    for _ in range(20):
        started.run()
    before = started.device.samples["fz"].time
    started.run(5 * PERIOD)
    after = started.device.samples["fz"].time
    assert after - before == pytest.approx(5 * PERIOD, abs=PERIOD)
    assert round((after - before) / PERIOD, 2) == round((after - before) / PERIOD)


def test_overrange_is_an_error_and_no_sample(started):
    started.loads["fz"] = 2000.0
    started.run(5e-3)
    assert started.device.error == "overrange"
    assert started.device.samples["fz"].value == 3.0


def test_one_bad_frame_of_a_burst_is_reported(started):
    started.loads["fz"] = 2000.0
    bad = b"".join(started.sensor.emit(started.time + 2 * PERIOD))
    started.loads["fz"] = 4.0
    good = b"".join(started.sensor.emit(started.time + 4 * PERIOD))
    started.device.receive(bad + good, started.time + 2 * PERIOD)
    assert started.device.error == "overrange"
    assert started.device.samples["fz"].value == 4.0


def test_the_error_ends_when_the_sensor_clears_it(started):
    started.loads["fz"] = 2000.0
    started.run(5e-3)
    started.loads["fz"] = 4.0
    started.run(5e-3)
    assert started.device.error == ""
    assert started.device.samples["fz"].value == 4.0


def with_status(data: bytes, status: int) -> bytes:
    """Return the first frame of the data with another status."""
    frame = struct.pack("<H", status) + data[3:35]
    register = 0xFFFF
    for byte in frame:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ 0x8408 * (register & 1)
    return b"\xaa" + frame + struct.pack("<H", register ^ 0xFFFF)


@pytest.mark.parametrize(("status", "error"), [(4, "invalid"), (8, "raw")])
def test_frames_that_are_no_measurements_are_an_error(started, status, error):
    sample = started.device.samples["fz"]
    started.garble = lambda data: with_status(data, status) if data else b""
    started.run(5e-3)
    assert started.device.error.startswith(error)
    assert started.device.samples["fz"] == sample


def test_frames_of_a_throttled_sensor_are_rejected(started):
    sample = started.device.samples["fz"]
    started.garble = lambda data: with_status(data, 1) if data else b""
    started.run(5e-3)
    assert started.device.rejected == {"throttled": 1}
    assert started.device.samples["fz"] == sample


def test_values_that_are_no_numbers_are_rejected(started):
    started.loads["mx"] = float("nan")
    started.run(2 * PERIOD)
    assert started.device.rejected == {"not finite": 2}
    assert started.device.samples["mx"].value == pytest.approx(0.1)


def test_a_sensor_restart_is_an_error_until_the_rig_is_opened_again(started):
    started.run(5e-3)
    started.sensor = EmulatedBota("tip", SETTINGS, started)
    for _ in range(20):
        started.run()
    assert "was restarted" in started.device.error
    started.device.start(started)
    started.run(5e-3)
    assert started.device.error == ""


def test_the_wrap_of_its_clock_is_not_a_restart(bench):
    bench.run()
    bench.sensor._power_up = bench.time - 2**32 * 1e-6 + 0.05
    bench.device.start(bench)
    for _ in range(200):
        bench.run()
        assert bench.time - bench.device.samples["fz"].time < 5e-3
    assert bench.device.error == ""


def test_the_configuration_mode_of_a_sensor_is_ended(bench):
    bench.sensor.receive(b"C", bench.time)
    bench.device.start(bench)
    assert bench.device.samples["fz"].value == 3.0


def test_a_wrong_baud_rate_is_guessed_from_noise(bench):
    bench.garble = lambda data: bytes(byte ^ 0x5A for byte in data if byte % 3)
    with pytest.raises(RigError) as refused:
        bench.device.start(bench)
    assert str(refused.value) == (
        f"tip: no valid frame in 1 s on force (/dev/ttyUSB0), but {bench.received} bytes: "
        "expected a Bota sensor at 460800 baud, check the baud rate"
    )
    assert bench.received > 1000


def test_a_silent_port_is_an_error(bench):
    bench.garble = lambda data: b""
    with pytest.raises(RigError, match="and no other byte: expected a Bota sensor with power on"):
        bench.device.start(bench)
