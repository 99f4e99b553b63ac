from __future__ import annotations

import struct

import pytest

from drivers.devices import ati_netft
from drivers.devices.ati_netft import SILENCE, AtiNetFt, AtiNetFtSettings
from drivers.rig import RigError
from drivers.transports.datagram_port import DatagramPort
from sim_backend.wire.devices.ati_netft import EmulatedAtiNetFt
from sim_backend.wire.emulated_device import Mount

TICK = 1e-3
LOADS = {"fx": 1.0, "fy": -2.0, "fz": 300.0, "mx": 0.1, "my": 0.2, "mz": -0.3}
START, STOP, LATCH = 2, 0, 0x41


class Bench(DatagramPort, Mount):
    """The port and the mount of the sensor in virtual time.

    `garble` changes the list of datagrams of a tick.
    """

    def __init__(self, monkeypatch, **entries):
        self.time = 100.0
        super().__init__("contact", lambda: self.time, "192.168.1.1", 49152)
        self.loads = dict(LOADS)
        self.settings = AtiNetFtSettings(kind="ati_netft", bus="contact", **entries)
        self.sensor = EmulatedAtiNetFt("tip", AtiNetFtSettings(kind="ati_netft", bus="x"), self)
        self.device = AtiNetFt("tip", self.settings)
        self.page = self.sensor.pages["/netftapi2.xml"]
        self.commands = []
        self.garble = list
        self.deaf = False
        monkeypatch.setattr(ati_netft, "read_page", self.read)

    def read(self, host, port):
        assert (host, port) == ("192.168.1.1", self.settings.http_port)
        if isinstance(self.page, Exception):
            raise self.page
        return self.page

    def sense(self, signal):
        return self.loads[signal]

    def drive(self, name, velocity):
        raise AssertionError

    brake = drive

    def send(self, data):
        self.commands.append(struct.unpack(">HHI", data)[1])
        if not self.deaf:
            self.sensor.receive(data, self.time)

    def run(self, ticks=1):
        for _ in range(ticks):
            self.time += TICK
            for data in self.garble(self.sensor.emit(self.time)):
                self.device.receive(data, self.time)
            self.device.update(self.time)

    def wait_for(self, condition, seconds):
        end = self.time + seconds
        while not condition() and self.time <= end:
            self.run()
        return bool(condition())

    @property
    def values(self):
        return {signal: sample.value for signal, sample in self.device.samples.items()}

    @property
    def age(self):
        return self.time - self.device.samples["fz"].time


@pytest.fixture
def make(monkeypatch):
    return lambda **entries: Bench(monkeypatch, **entries)


@pytest.fixture
def bench(make):
    bench = make()
    bench.device.start(bench)
    return bench


def refusal(bench):
    with pytest.raises(RigError) as refused:
        bench.device.start(bench)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_measures_the_values_of_the_sensor(bench):
    bench.run(5)
    assert bench.values == pytest.approx(LOADS, abs=1e-6)
    assert bench.device.signals().keys() == bench.values.keys()
    assert bench.age == 0.0
    assert not bench.device.rejected
    assert not bench.device.error


def test_the_stream_is_requested_once_and_ended(bench):
    bench.run(100)
    bench.device.stop()
    assert bench.commands == [START, STOP]
    bench.run(200)
    assert bench.age > 0.1
    assert bench.commands == [START, STOP]


def test_lost_records_are_counted(bench):
    bench.garble = lambda data: []
    bench.run(3)
    bench.garble = list
    bench.run(2)
    assert bench.device.rejected == {"lost": 3}
    assert bench.age == 0.0


def test_repeated_and_overtaken_records_are_counted_and_not_used(bench):
    seen = []

    def garble(data):
        seen.extend(data)
        return [seen[-1], seen[-1], seen[-2]] if len(seen) > 1 else data

    bench.garble = garble
    bench.run(1)
    bench.loads["fz"] = 5.0
    bench.run(1)
    assert bench.device.rejected == {"repeated": 1, "overtaken": 1}
    assert bench.values["fz"] == pytest.approx(5.0)


def test_a_sensor_that_repeats_its_internal_sample_gives_no_new_sample(bench):
    """Its stream goes on, but it measures no more."""
    frozen = []

    def garble(data):
        frozen.extend(data[: 1 - len(frozen)])
        return [one[:4] + frozen[0][4:] for one in data]

    bench.garble = garble
    bench.run(50)
    assert bench.device.rejected["repeated"] > 40
    assert bench.age > 0.04


@pytest.mark.parametrize("length", [0, 35, 37])
def test_a_record_of_another_length_is_rejected(bench, length):
    bench.garble = lambda data: [bytes(length)]
    bench.run(2)
    assert bench.device.rejected == {"length": 2}


def test_of_several_records_in_a_tick_the_newest_is_used(bench):
    bench.time += 10e-3
    bench.loads["fz"] = 7.0
    bench.run(1)
    assert bench.values["fz"] == pytest.approx(7.0)
    assert not bench.device.rejected


def test_saturation_in_one_record_of_a_tick_is_an_error_and_no_sample(bench):
    good = bench.sensor.emit(bench.time + TICK)
    bench.loads["fz"] = -2000.0
    bad = bench.sensor.emit(bench.time + 2 * TICK)
    bench.loads["fz"] = 5.0
    after = bench.sensor.emit(bench.time + 3 * TICK)
    bench.garble = lambda data: good + bad
    bench.run(1)
    assert bench.device.error == "saturation or A/D error"
    assert bench.values["fz"] == pytest.approx(300.0)
    bench.device.start(bench)
    bench.garble = lambda data: [*after, *bad_again, *good_again]
    bench.loads["fz"] = -2000.0
    bad_again = bench.sensor.emit(bench.time + 4 * TICK)
    bench.loads["fz"] = 6.0
    good_again = bench.sensor.emit(bench.time + 5 * TICK)
    bench.run(1)
    assert bench.device.error == "saturation or A/D error"
    assert bench.values["fz"] == pytest.approx(6.0)
    bench.time += 5 * TICK
    bench.garble = list
    bench.run(1)
    assert bench.device.error == ""


def test_the_error_remains_while_no_record_arrives(bench):
    bench.loads["fz"] = 2000.0
    bench.run(2)
    bench.garble = lambda data: []
    bench.run(20)
    assert bench.device.error == "saturation or A/D error"


def test_a_silent_stream_is_requested_again_and_the_ages_show_the_silence(bench):
    bench.sensor = EmulatedAtiNetFt("tip", bench.sensor.settings, bench)
    bench.deaf = True
    bench.run(round(SILENCE / TICK) - 2)
    assert bench.commands == [START]
    bench.run(4)
    assert bench.commands == [START, START]
    assert bench.age > 0.1
    bench.run(round(2 * SILENCE / TICK))
    assert bench.commands == [START] * 4


def test_a_stream_that_was_requested_again_begins_with_record_1_and_none_is_lost(bench):
    bench.run(50)
    bench.send(struct.pack(">HHI", 0x1234, STOP, 0))
    bench.run(round(SILENCE / TICK) + 5)
    assert bench.age < 5e-3
    assert not bench.device.rejected
    assert not bench.device.error


@pytest.mark.parametrize("uptime", [10.0, 1e5, 4e5])
def test_a_restarted_sensor_is_an_error_until_the_rig_is_opened_again(make, uptime):
    bench = make()
    bench.sensor._power_up = bench.time - uptime  # 4e5 s: more than half of the range
    bench.device.start(bench)
    bench.run(50)
    bench.sensor = EmulatedAtiNetFt("tip", bench.sensor.settings, bench)
    bench.run(300)
    assert bench.device.error == "the sensor was restarted: open the rig again"
    bench.device.rearm()
    bench.run(1)
    assert bench.device.error
    bench.device.start(bench)
    bench.run(5)
    assert bench.device.error == ""


def test_the_wrap_of_its_counter_is_not_a_restart(make):
    bench = make()
    bench.sensor._power_up = bench.time - (2**32 - 200) / 7000
    bench.device.start(bench)
    bench.run(200)
    assert bench.device.error == ""
    assert not bench.device.rejected
    assert bench.age == 0.0


def test_a_long_interruption_is_not_a_restart(bench):
    bench.run(5)
    bench.garble = lambda data: []
    bench.run(5000)
    bench.garble = list
    bench.run(5)
    assert bench.device.error == ""


def test_rearming_resets_the_latch_of_the_monitor_conditions(bench):
    bench.device.rearm()
    assert bench.commands == [START, LATCH]


def test_another_unit_is_converted(make):
    bench = make()
    bench.page = bench.page.replace(b"<scfgfu>N<", b"<scfgfu>kN<")
    bench.device.start(bench)
    assert bench.values["fz"] == pytest.approx(300e3)
    assert bench.values["mx"] == pytest.approx(0.1)


WHERE = "tip: http://192.168.1.1:80/netftapi2.xml: "


@pytest.mark.parametrize(
    ("entries", "old", "new", "problem"),
    [
        ({}, b"<scfgfu>N<", b"<scfgfu>pond<", "scfgfu is 'pond': expected one of"),
        ({"counts_per_n": 1e5}, b"", b"", "counts_per_n 1000000, expected 100000"),
        ({"counts_per_nm": 1e6}, b"<scfgtu>Nm<", b"<scfgtu>Nmm<", "counts_per_nm 1e+09, expected"),
        ({"serial": "FT2"}, b"", b"", "serial number 'FT00001', expected 'FT2'"),
        ({}, b"Enabled", b"Disabled", "RDT is disabled: expected enabled"),
        ({}, b"<netft>", b"<html>", "not the page of a Net F/T sensor"),
    ],
)
def test_a_sensor_that_differs_from_the_rig_file_is_refused(make, entries, old, new, problem):
    bench = make(**entries)
    bench.page = bench.page.replace(old, new)
    assert refusal(bench).startswith(WHERE + problem)
    assert bench.commands == []


def test_without_a_web_server_the_scales_of_the_rig_file_are_needed(make):
    bench = make(counts_per_n=1e6)
    bench.page = ConnectionRefusedError(111, "refused")
    assert refusal(bench).startswith(f"{WHERE}connection refused: expected the web server of a")
    bench = make(counts_per_n=1e6, counts_per_nm=1e6)
    bench.page = TimeoutError("timed out")
    bench.device.start(bench)
    assert bench.values == pytest.approx(LOADS, abs=1e-6)


def test_a_sensor_without_records_is_named(make):
    bench = make()
    bench.deaf = True
    assert refusal(bench) == (
        "tip: no record in 1 s on contact (UDP port 192.168.1.1:49152): expected a Net F/T sensor "
        "with RDT at this port"
    )
    assert len(bench.commands) > 5  # the requests can be lost


def test_a_slow_stream_is_not_requested_again(make):
    bench = make()
    bench.rate = 5.0
    bench.sensor = EmulatedAtiNetFt("tip", bench.sensor.settings, bench)
    bench.page = bench.sensor.pages["/netftapi2.xml"]
    bench.device.start(bench)
    bench.run(1000)
    assert bench.commands == [START]
    assert not bench.device.rejected
