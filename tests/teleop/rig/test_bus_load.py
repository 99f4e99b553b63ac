"""The load of a bus is the time for which it carries data, as a fraction of the time."""

from __future__ import annotations

import math

import pytest

from drivers.transports.stream_port import StreamPort
from teleop.rig.bus_load import BusLoad, overloaded


class Line(StreamPort):
    """A serial line on which this computer writes, at a time that the test sets."""

    def __init__(self, baud):
        self.time = 0.0
        super().__init__("line", lambda: self.time, "/dev/ttyX", baud)

    def open(self):
        pass

    def close(self):
        pass

    def _read(self):
        return b""

    def _write(self, data):
        return len(data)


def load_of(line, ticks=100, size=20, period=1e-3):
    load = BusLoad({"line": line})
    for _ in range(ticks):
        line.write(bytes(size))
        load.update()
        line.time += period
    return load.loads()["line"]


def test_twenty_bytes_a_millisecond_use_a_line_of_one_megabaud_for_a_fifth_of_the_time():
    assert load_of(Line(1_000_000)) == pytest.approx(0.2)


def test_the_load_of_a_network_or_of_no_traffic_is_not_known():
    assert math.isnan(load_of(Line(None)))
    assert math.isnan(BusLoad({"line": Line(9600)}).loads()["line"])


def test_a_bus_with_too_much_load_is_named_with_what_to_change():
    (line,) = overloaded({"can0": 0.9, "usb": 0.5, "net": math.nan}, 1000.0)
    assert line.startswith("bus can0 carries data for 90% of the time at 1000 Hz: expected at most")
