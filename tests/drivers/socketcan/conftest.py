"""A virtual SocketCAN interface. Run these tests by .ci/socketcan on hosts without one."""

from __future__ import annotations

import shutil
import socket
import subprocess
from collections.abc import Iterator

import can
import pytest


@pytest.fixture(scope="session")
def vcan0() -> Iterator[str]:
    missing = [tool for tool in ("ip", "candump", "cansend") if not shutil.which(tool)]
    if missing:
        pytest.skip(f"{', '.join(missing)} not found: run .ci/socketcan")
    if "vcan0" in [name for _, name in socket.if_nameindex()]:
        yield "vcan0"
        return
    create = ["ip", "link", "add", "vcan0", "up", "type", "vcan"]
    if error := subprocess.run(create, capture_output=True, text=True).stderr:
        pytest.skip(f"no vcan0 ({error.strip()}): run .ci/socketcan")
    yield "vcan0"
    subprocess.run(["ip", "link", "delete", "vcan0"], check=True)


@pytest.fixture
def bus(vcan0: str) -> Iterator[can.BusABC]:
    with can.Bus(vcan0, interface="socketcan") as bus:
        yield bus
