"""CAN buses of python-can between a host and emulated devices."""

from __future__ import annotations

import can
import pytest

from sim_backend.wire.can_wires import InterfaceWire


@pytest.mark.parametrize("fd", [False, True])
def test_a_bus_without_a_file_descriptor_is_served_and_has_the_wanted_frames(fd):
    wire = InterfaceWire("virtual", f"wire-{fd}", fd, [])
    wire.open()
    protocol = can.CanProtocol.CAN_FD if fd else can.CanProtocol.CAN_20
    with can.Bus(interface="virtual", channel=f"wire-{fd}", protocol=protocol) as host:
        assert wire.filenos() == []
        frame = can.Message(arbitration_id=5, is_fd=fd, data=bytes(12 if fd else 8))
        host.send(frame)
        assert [received.data for received in wire.from_host()] == [frame.data]
        wire.send([frame])
        assert host.recv(1.0).is_fd == fd
    wire.close()
    assert wire.filenos() == []
