"""Find the serial ports and CAN buses of this computer."""

from __future__ import annotations

import logging
from typing import NamedTuple

import can
from serial.tools import list_ports


class Port(NamedTuple):
    """Properties of a serial port or CAN bus of this computer."""

    kind: str
    """`serial` or `can`."""
    interface: str
    """Name of python-can's interface; empty for a serial port."""
    name: str
    """Device file or COM port of a serial port, or python-can's channel of a CAN bus."""
    description: str
    """Description that the operating system or the CAN library gives; may be empty."""
    hardware: str
    """Hardware identification of a serial port, for example USB ids; may be empty."""


def available_ports() -> list[Port]:
    """Return all serial ports, then all CAN buses.

    An slcan adapter is listed as a serial port.
    """
    ports = [
        Port("serial", "", p.device, known(p.description), known(p.hwid))
        for p in sorted(list_ports.comports())
    ]
    logging.getLogger("can").setLevel(logging.CRITICAL)
    buses = can.detect_available_configs(interfaces=INTERFACES)
    return ports + [
        Port("can", str(b["interface"]), str(b["channel"]), description(b), "") for b in buses
    ]


INTERFACES = ("socketcan", "pcan", "kvaser", "ixxat", "vector", "gs_usb", "usb2can", "canalystii")
"""Interfaces of python-can that are searched for buses.

If the library of an interface is not installed, no buses of this interface are found.
"""


def description(config: can.typechecking.AutoDetectedConfig) -> str:
    """Return a text that lists properties of a CAN bus, except its interface and channel."""
    known = {k: v for k, v in config.items() if k not in ("interface", "channel")}
    return ", ".join(f"{name} {value}" for name, value in known.items())


def known(text: str | None) -> str:
    """Return a property of a port as text. If pyserial gives None or `n/a`, the text is empty."""
    return "" if text in (None, "n/a") else str(text)
