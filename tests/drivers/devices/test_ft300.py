from __future__ import annotations

import pytest

from drivers.devices.ft300 import Ft300, Ft300Settings
from drivers.rig import RigError
from sim_backend.wire.devices.ft300 import PERIOD, EmulatedFt300

SETTINGS = Ft300Settings(kind="ft300", bus="force")
TICK = 1e-3
LINE_TIME = 16 * 10 / 19200


LOADS = {"fx": 1.0, "fy": -2.0, "fz": 3.0, "mx": 0.01, "my": -0.02, "mz": 0.03}


@pytest.fixture
def bench(sensor_bench):
    return sensor_bench(Ft300, EmulatedFt300, SETTINGS, LOADS, "COM3", 19200)


def test_starts_the_stream_and_measures_the_sensed_values(bench):
    bench.device.start(bench)
    assert bench.written == [bytes.fromhex("0910019A0001020200CDCA")]
    values = {signal: sample.value for signal, sample in bench.device.samples.items()}
    assert values == pytest.approx(bench.loads)


def test_the_answer_to_the_request_is_no_loss(bench):
    bench.device.start(bench)
    assert not bench.device.rejected


def test_a_sensor_that_already_streams_gets_no_request(bench):
    bench.device.start(bench)
    bench.device.start(bench)
    assert len(bench.written) == 1


def test_a_sample_is_dated_before_its_frame_went_over_the_line(bench):
    bench.device.start(bench)
    for _ in range(50):
        bench.run()
        age = bench.time - bench.device.samples["fz"].time
        assert LINE_TIME < age < LINE_TIME + PERIOD + 2 * TICK


def test_of_a_burst_the_newest_frame_is_used(bench):
    bench.device.start(bench)
    bench.loads["fz"] = 4.0
    first = b"".join(bench.sensor.emit(bench.time + PERIOD))
    bench.loads["fz"] = 5.0
    bench.device.receive(first + b"".join(bench.sensor.emit(bench.time + 2 * PERIOD)), bench.time)
    assert bench.device.samples["fz"].value == 5.0


def test_a_corrupted_frame_is_counted_and_not_a_sample(bench):
    bench.device.start(bench)
    sample = bench.device.samples["fz"]
    bench.garble = lambda data: data.replace(b"\x2c\x01", b"\x2d\x01")
    bench.run(PERIOD)
    assert bench.device.rejected == {"checksum": 1, "noise": 15}
    assert bench.device.samples["fz"] == sample


def test_stop_ends_the_stream(bench):
    bench.device.start(bench)
    bench.device.stop()
    sent = bench.received
    bench.run(10 * PERIOD)
    assert bench.received == sent


def test_stop_of_a_port_that_is_gone_is_no_error(bench):
    bench.device.start(bench)

    def write(data: bytes) -> None:
        raise RigError("force: port COM3 is gone")

    bench.write = write
    bench.device.stop()


def test_stop_without_start_sends_nothing(bench):
    bench.device.stop()
    assert not bench.written


def test_a_wrong_baud_rate_is_guessed_from_noise(bench):
    bench.garble = lambda data: bytes(byte ^ 0x5A for byte in data)
    with pytest.raises(RigError) as refused:
        bench.device.start(bench)
    assert str(refused.value) == (
        f"tip: no valid frame in 1 s on force (COM3), but {bench.received} bytes: "
        "expected an FT 300 at 19200 baud, check the baud rate"
    )


def test_a_silent_port_is_an_error(bench):
    bench.garble = lambda data: b""
    with pytest.raises(RigError, match="and no other byte: expected an FT 300 with power on"):
        bench.device.start(bench)
