"""A search for a sequence of wire faults and requests after which a wired rig goes on moving.

    WIRE_SEARCH_TRIALS=300 pytest tests/teleop/wire/test_wire_search.py

runs so many trials on each rig; by default it is a sample.
"""

from __future__ import annotations

import contextlib
import math
import os

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from drivers import STANDSTILL, RigError
from drivers.rig_sections import CanSettings
from sim_backend.wire.emulator import ACTIONS, PlannedFault
from sim_backend.wire.wire_faults import FAULTS, ON_CAN
from teleop.safety import Fault, Mode, Request
from teleop.safety.channels import DetectedFault
from teleop.trial.assembly import make_clock, make_controller

TRIALS = int(os.environ.get("WIRE_SEARCH_TRIALS", "3"))
TICKS = 450
BOUND = 0.3
"""Longest time from a fault until all drives are disabled [s].

It includes 84 ms until a fault is detected, the ramp, and the slowest watchdog of the rigs,
100 ms.
"""
KEY = DetectedFault(Fault.EMERGENCY_STOP, "key", math.nan, math.nan, math.nan)
STOPS = {"Ctrl-C": {"stop": "Ctrl-C"}, "twice": {"halt": True}, "key": {"faults": (KEY,)}}


@st.composite
def wire_faults(draw, file):
    """Return one to five faults of the rig's buses and devices during the trial."""
    buses = dict(file.sections.buses)
    devices = [name for name, device in file.devices.items() if hasattr(device, "bus")]
    faults = []
    for _ in range(draw(st.integers(1, 5))):
        kind = draw(st.sampled_from([*FAULTS, *ACTIONS]))
        can = [name for name, bus in buses.items() if isinstance(bus, CanSettings)]
        places = devices if kind == "reset" else can if kind in ON_CAN else list(buses)
        if places:
            at = draw(st.floats(0.0, 0.3))
            faults.append(PlannedFault(kind, draw(st.sampled_from(places)), at))
    return faults


def check(record, limits, before):
    """Check the safety rules for one tick."""
    m, command = record.measurement, record.commanded
    low, high = limits.hard_position
    for new, old, most, pull in (
        (command[0], before[0], limits.max_master_velocity, limits.max_master_acceleration),
        (command[1], before[1], limits.max_velocity, limits.max_acceleration),
    ):
        assert abs(new) <= most * (1 + 1e-9)
        change = pull * max(record.dt, 0.0) * (1 + 1e-9) + 1e-12
        assert abs(new - old) <= change or command == STANDSTILL
    dangerous = (
        m.emergency_stop
        or bool(m.drive_error)
        or limits.hard_force < abs(m.contact_force) < math.inf
        or high < m.slave_position < math.inf
        or -math.inf < m.slave_position < low
    )
    assert command == STANDSTILL or not dangerous


def odrive_of_firmware_05(text):
    return text.replace('"0.6"', '"0.5"\ntorque_constant_nm_per_a = 0.04')


def on_virtual_bus(text):
    return text.replace('"socketcan"', '"virtual"').replace('"can0"', '"moteus-search"')


@pytest.mark.parametrize(
    ("name", "edit"),
    [
        ("serial-board", str),
        ("odrive-bota", str),
        ("odrive-reaction-force", odrive_of_firmware_05),
        ("cia402-ft300", str),
        ("ati-netft", str),
        ("moteus", on_virtual_bus),
        ("haply", str),
    ],
)
def test_no_sequence_of_wire_faults_and_requests_leaves_a_wired_rig_moving(in_memory, name, edit):
    trial = in_memory(name, duration=2.0, edit=edit)
    limits = trial.settings.limits

    @settings(
        max_examples=TRIALS,
        deadline=None,
        database=None,
        phases=[Phase.explicit, Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(
        wire_faults(trial.file),
        st.sampled_from([None, None, *STOPS]),
        st.integers(60, 400),
        st.booleans(),
    )
    def search(faults, stop, stop_at, rearm):
        clock, emulators = make_clock(trial.settings), []
        case = in_memory(name, duration=2.0, faults=faults, prepare=emulators.append, edit=edit)
        with contextlib.suppress(RigError), case.make_rig(clock.now) as rig:
            # a rig whose port is missing cannot be closed without an error
            run(case, rig, clock, emulators[0], stop, stop_at, rearm)

    def run(case, rig, clock, emulator, stop, stop_at, rearm):
        controller = make_controller(case.settings, rig, clock)
        command, tripped, rearmed = STANDSTILL, math.inf, False
        for n in range(TICKS + 400):
            tick = clock.wait()
            asked = STOPS[stop] if stop and n >= stop_at else {}
            arm = not asked and not (rearmed and tripped < math.inf)
            record = controller.tick(tick, Request(arm=arm, **asked))
            check(record, limits, command)
            command = record.commanded
            if record.mode is Mode.FAULT:
                tripped = min(tripped, clock.now())
                assert command == STANDSTILL or clock.now() - tripped <= BOUND
                if clock.now() - tripped > BOUND:
                    assert not emulator.mechanism.driven
                    if rearm and not rearmed and not asked:
                        controller.rearm()
                        rearmed, tripped = True, math.inf
            elif asked and n > stop_at + 200:
                assert not emulator.mechanism.driven
            if n >= TICKS and clock.now() - tripped > BOUND + 0.05:
                break

    search()
