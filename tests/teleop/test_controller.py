"""What the controller does with each channel and each dt, told by a rig of distinct values."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers import Ages, Command, Measurement, Rig
from estimation import Excitation, MatchedFilter, paper_preset
from teleop.admittance import Admittance, AdmittanceParameters, Coupling
from teleop.clock import Tick
from teleop.conditions import Teleoperation
from teleop.controller import Controller
from teleop.errors import SafetyStop
from teleop.log import Log

PERIOD = 1e-3
TIMES = np.cumsum(PERIOD * (1.0 + 0.5 * np.random.default_rng(0).uniform(-1.0, 1.0, 300)))


class SpyRig(Rig):
    """Channels that differ in every sample; drives that apply a third of the command."""

    def __init__(self, **overrides: float) -> None:
        self.tick = -1
        self.overrides = overrides
        self.written: list[Command] = []
        self.stopped = 0

    def open(self): ...

    def close(self): ...

    def stop(self):
        self.stopped += 1

    def channels(self, n):
        t = TIMES[n]
        x = 4e-3 + 3e-3 * math.sin(9.0 * t)
        return {
            "master_force": 1.0 + 2.0 * math.sin(5.0 * t),
            "master_position": 0.1 + t,
            "slave_position": x,
            "contact_force": 2100.0 * x + 20.0 * 27e-3 * math.cos(9.0 * t),
            "slave_velocity": 7.0 + t,
        }

    def read(self):
        self.tick += 1
        values = self.channels(self.tick) | (self.overrides if self.tick == 200 else {})
        return Measurement(time=float(TIMES[self.tick]), age=Ages(*[0.0] * 5), **values)

    def write(self, command):
        self.written.append(command)
        return Command(*(velocity / 3.0 for velocity in command))


def make(rig):
    return Controller(
        rig,
        Teleoperation(),
        Admittance(AdmittanceParameters()),
        Coupling(0.5, position_gain=2.0),
        MatchedFilter(20.0),
        paper_preset().bank(),
        Excitation(),
        PERIOD,
    )


def test_every_stage_gets_its_channel_and_the_measured_dt():
    rig = SpyRig()
    controller = make(rig)
    log = Log(paper_preset().bank())
    records = []
    for _ in TIMES:
        records.append(controller.tick())
        log.append(Tick(0.25, True, 3), records[-1])

    dt = np.diff(TIMES, prepend=TIMES[0] - PERIOD)
    channels = [rig.channels(n) for n in range(len(TIMES))]
    position = np.array([c["slave_position"] for c in channels])
    force = np.array([c["contact_force"] for c in channels])
    x, v, f = MatchedFilter(20.0).run(position, force, dt)
    estimates = paper_preset().bank().run(x, v, f, dt)
    measure = Excitation()
    excitation = [measure.update(*sample) for sample in zip(x, v, dt, strict=True)]
    admittance, coupling = Admittance(AdmittanceParameters()), Coupling(0.5, 2.0)
    desired = []
    for channel, step in zip(channels, dt, strict=True):
        admittance.step(channel["master_force"], step)
        desired.append(coupling.command(admittance, channel["slave_position"]))

    expected = {
        "Time": TIMES - TIMES[0],
        "Sample period": dt,
        "Displacement": position,
        "Force": force,
        "Filtered displacement": x,
        "Filtered velocity": v,
        "Filtered force": f,
        "Slave velocity": [c["slave_velocity"] for c in channels],
        "Master position": [c["master_position"] for c in channels],
        "Master force": [c["master_force"] for c in channels],
        "Drive force": [c["master_force"] for c in channels],
        "Desired slave velocity": [c.slave_velocity for c in desired],
        "Applied slave velocity": [c.slave_velocity / 3.0 for c in desired],
        "Applied master velocity": [c.master_velocity / 3.0 for c in desired],
        "Lateness": np.full(len(TIMES), 0.25),
        "Overrun": np.ones(len(TIMES)),
        "Skipped periods": np.full(len(TIMES), 3.0),
        "Excitation": excitation,
    }
    for name, (b, k) in estimates.items():
        expected |= {f"{name.upper()} b": b, f"{name.upper()} k": k}
    columns = log.columns()
    assert list(columns) == list(log.units)
    assert set(columns) == set(expected)
    for name, column in expected.items():
        np.testing.assert_allclose(columns[name], column, rtol=1e-9, atol=1e-12, err_msg=name)
    assert [c.slave_velocity for c in rig.written] == list(columns["Desired slave velocity"])


@pytest.mark.parametrize("channel", ["master_force", "slave_position", "contact_force"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_channel_that_is_no_number_stops_the_rig_and_reaches_no_drive(channel, value):
    rig = SpyRig(**{channel: value})
    controller = make(rig)

    def run():
        with rig:
            for _ in TIMES:
                controller.tick()

    with pytest.raises(SafetyStop, match=channel.replace("_", " ")):
        run()
    assert len(rig.written) == 200
    assert all(math.isfinite(v) for command in rig.written for v in command)
    assert rig.stopped == 1


def test_a_channel_that_the_loop_does_not_need_may_be_missing():
    controller = make(SpyRig(slave_velocity=math.nan, master_position=math.nan))
    for _ in TIMES:
        controller.tick()
