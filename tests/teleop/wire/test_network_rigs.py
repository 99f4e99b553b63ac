"""Trials on emulated devices that are connected by a network."""

from __future__ import annotations

import pytest

from sim_backend.wire.emulator import PlannedFault
from teleop.safety import Fault, Mode

AT = 0.2
"""Time of a fault after the drives were enabled [s]."""
RATE = 500.0
"""Rate of the loop [Hz]."""


def on_tcp(text):
    """Connect the microcontroller board by TCP."""
    return text.replace(
        'kind = "serial"\nport = "/dev/ttyACM0"', 'kind = "tcp"\nhost = "192.168.1.5"\nport = 4001'
    )


@pytest.mark.parametrize("kind", ["double", "corrupt", "noise", "truncate", "length"])
def test_a_board_on_tcp_tolerates_what_a_board_on_a_serial_line_tolerates(in_memory, kind):
    fault = PlannedFault(kind, "usb", AT)
    trial = in_memory("serial-board", duration=0.45, rate=RATE, faults=[fault], edit=on_tcp).run()
    assert trial.fault is None
    assert trial.recording["contact_force_age"].max() < 0.02


@pytest.mark.parametrize("kind", ["silence", "unplug"])
def test_a_lost_tcp_connection_stops_the_rig(in_memory, kind):
    faults = [PlannedFault(kind, "usb", AT), PlannedFault("replug", "usb", AT + 0.1)]
    trial = in_memory(
        "serial-board",
        duration=0.45,
        rate=RATE,
        faults=faults[: 1 + (kind == "unplug")],
        edit=on_tcp,
    ).run()
    if kind == "unplug":
        assert trial.fault["fault"] == Fault.RIG_FAILURE
        assert "is disconnected: " in trial.fault["text"]
    else:
        assert trial.fault["fault"] == Fault.STALE
    assert trial.recording["mode"][-1] == Mode.FAULT
