"""Detection of the serial ports and CAN buses of this computer."""

from __future__ import annotations

import logging
from typing import NamedTuple

import can
from serial.tools import list_ports


class Port(NamedTuple):
    """A serial port or CAN bus, with its names in a rig file."""

    kind: str
    """`serial` or `can`."""
    interface: str
    """Name of python-can's interface; empty for a serial port."""
    name: str
    """Serial port, or channel of a CAN bus."""
    description: str
    """Description by the operating system; may be empty."""
    hardware: str
    """USB vendor, product and serial number; may be empty."""


def available_ports() -> list[Port]:
    """Return all serial ports, then all CAN buses. An slcan adapter is listed as serial port."""
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
"""Interfaces that python-can can search. Without its library, an interface finds no buses."""


def description(config: can.typechecking.AutoDetectedConfig) -> str:
    """Return the other properties of a bus, as text."""
    known = {k: v for k, v in config.items() if k not in ("interface", "channel")}
    return ", ".join(f"{name} {value}" for name, value in known.items())


def known(text: str | None) -> str:
    """Return a text of pyserial; empty for `n/a`."""
    return "" if text in (None, "n/a") else str(text)
