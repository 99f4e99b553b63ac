from __future__ import annotations

import pytest

from drivers import AXES, CHANNELS, UNITS, Ages, Command, Measurement, Rig
from drivers.rig_sections import (
    ChannelsSettings,
    DrivesSettings,
    ForceSettings,
    PositionSettings,
    VelocitySettings,
)


class Recorder(Rig):
    def __init__(self, failing: str = "") -> None:
        self.calls: list[str] = []
        self.failing = failing

    def call(self, name: str):
        self.calls.append(name)
        if name == self.failing:
            raise OSError(f"{name} failed")

    def open(self):
        self.call("open")

    def read(self):
        raise NotImplementedError

    def write(self, command):
        self.call("write")
        return command

    def enable(self):
        self.call("enable")
        return True

    def idle(self):
        self.call("idle")
        return True

    def close(self):
        self.call("close")


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_every_exit_idles_the_drives_and_then_closes(error):
    rig = Recorder()
    with pytest.raises(error), rig:
        raise error
    assert rig.calls == ["open", "idle", "close"]


def test_a_normal_exit_idles_and_closes_too():
    rig = Recorder()
    with rig:
        pass
    assert rig.calls == ["open", "idle", "close"]


def test_an_open_that_fails_still_closes():
    rig = Recorder(failing="open")
    with pytest.raises(OSError, match="open failed"), rig:
        pass
    assert rig.calls == ["open", "close"]


def test_an_idle_that_fails_still_closes():
    rig = Recorder(failing="idle")
    with pytest.raises(OSError, match="idle failed"), rig:
        pass
    assert rig.calls == ["open", "idle", "close"]


def test_measurement_ages_and_rig_file_have_the_same_channels_in_the_same_units():
    sections = {ForceSettings: "N", PositionSettings: "m", VelocitySettings: "m/s"}
    fields = ChannelsSettings.model_fields
    kinds = {
        name: next(unit for kind, unit in sections.items() if kind.__name__ in str(field))
        for name, field in fields.items()
    }
    assert kinds == UNITS
    assert Ages._fields == CHANNELS
    values = dict(zip(CHANNELS, range(5), strict=True))
    measurement = Measurement(time=9.0, age=Ages(*range(5)), **values)
    assert measurement.channels == tuple(range(5))


def test_drives_are_in_the_order_of_a_command():
    assert AXES == ("master", "slave")
    assert Command._fields == tuple(f"{axis}_velocity" for axis in AXES)
    assert set(DrivesSettings.model_fields) == set(AXES)
