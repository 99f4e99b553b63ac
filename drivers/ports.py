"""The serial ports and CAN buses that this machine has."""

from __future__ import annotations

import logging
from typing import NamedTuple

import can
from serial.tools import list_ports


class Port(NamedTuple):
    """A port or bus, as a rig file names it."""

    kind: str
    """`serial` or `can`."""
    interface: str
    """python-can's interface; empty for a serial port."""
    name: str
    """The port, or the channel of a CAN bus."""
    description: str
    hardware: str
    """USB vendor, product and serial number, where there are any."""


def found() -> list[Port]:
    """Serial ports, then CAN buses; an slcan adapter is listed as the serial port that it is."""
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
"""Interfaces whose buses python-can finds; those without their library find none."""


def description(config: can.typechecking.AutoDetectedConfig) -> str:
    """What else is known of a bus."""
    known = {k: v for k, v in config.items() if k not in ("interface", "channel")}
    return ", ".join(f"{name} {value}" for name, value in known.items())


def known(text: str | None) -> str:
    """What pyserial knows; empty where it says `n/a`."""
    return "" if text in (None, "n/a") else str(text)
