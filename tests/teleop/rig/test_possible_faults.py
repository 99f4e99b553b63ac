"""The faults that the emulator can cause on each kind of bus."""

from __future__ import annotations

import pytest

from drivers.rig_sections import CanSettings, SerialSettings, TcpSettings, UdpSettings
from sim_backend.wire.wire_faults import FAULTS
from teleop.rig.emulation import is_possible

EVERYWHERE = {
    "drop",
    "gaps",
    "double",
    "reorder",
    "delay",
    "truncate",
    "length",
    "burst",
    "silence",
}
ON_LINES = {"corrupt", "noise", "baud", "unplug", "replug"}
ON_CAN = {"error-frames", "bus-off"}


@pytest.mark.parametrize(
    ("bus", "possible"),
    [
        (SerialSettings(kind="serial", port="a", baud_bps=1), EVERYWHERE | ON_LINES),
        (TcpSettings(kind="tcp", host="a", port=1), EVERYWHERE | ON_LINES),
        (UdpSettings(kind="udp", host="a", port=1), (EVERYWHERE | ON_LINES) - {"baud"}),
        (CanSettings(kind="can", interface="socketcan", channel="a"), EVERYWHERE | ON_CAN),
        (CanSettings(kind="can", interface="slcan", channel="a"), EVERYWHERE | ON_LINES | ON_CAN),
    ],
    ids=["serial", "tcp", "udp", "can", "slcan"],
)
def test_each_kind_of_bus_has_its_faults(bus, possible):
    kinds = [*FAULTS, "unplug", "replug"]
    assert {kind for kind in kinds if is_possible(kind, bus)} == possible
