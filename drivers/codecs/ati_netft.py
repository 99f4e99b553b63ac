"""Encode and decode the protocol RDT (raw data transfer) of ATI's Net F/T force-torque sensors.

The host sends requests of 8 bytes to UDP port 49152 of the sensor. The sensor answers with records
of 36 bytes, one per datagram. All numbers are big-endian. The page `netftapi2.xml` of the sensor's
web server has the number of counts per unit of force and torque. See ATI Industrial Automation,
Net F/T Installation and Operation Manual (9620-05-NET FT), chapters 9 and 10, and table 17.1.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import NamedTuple
from xml.etree import ElementTree

REQUEST = struct.Struct(">HHI")
RECORD = struct.Struct(">III6i")
HEADER = 0x1234
STOP, START, RESET_LATCH = 0x0000, 0x0002, 0x0041
"""Commands: stop the stream, start the real-time stream, reset the latch of the monitor conditions.
"""
PAGE = "/netftapi2.xml"
"""Path of the page with the configuration of the sensor."""
INTERNAL_RATE = 7000.0
"""Rate of the counter `ft_sequence` of a Net F/T [Hz]."""
FORCE_UNITS = {
    "N": 1.0,
    "kN": 1e3,
    "lbf": 4.4482216152605,
    "klbf": 4448.2216152605,
    "kgf": 9.80665,
    "gf": 9.80665e-3,
}
"""Units of force, in N."""
TORQUE_UNITS = {
    "Nm": 1.0,
    "Nmm": 1e-3,
    "kNm": 1e3,
    "lbfin": 0.1129848290276167,
    "lbfft": 1.3558179483314004,
    "kgfcm": 0.0980665,
}
"""Units of torque, in N m. The names contain no separators."""
NET_FT_STATUS = {
    1 << 17: "saturation or A/D error",
    1 << 30: "CPU or RAM error",
    1 << 29: "digital board error",
    1 << 28: "analog board error",
    1 << 27: "serial link communication error",
    1 << 26: "program memory error",
    1 << 25: "halted due to configuration errors",
    1 << 24: "settings validation error",
    1 << 23: "configuration incompatible with calibration",
    1 << 22: "network communication failure",
    1 << 21: "CAN communication error",
    1 << 20: "RDT communication error",
    1 << 19: "EtherNet/IP protocol failure",
    1 << 18: "DeviceNet protocol failure",
    1 << 16: "monitor condition latched",
    1 << 14: "watchdog time-out",
    1 << 13: "stack check error",
    1 << 12: "serial EEPROM failure",
    1 << 11: "serial flash failure",
    1 << 10: "watchdog time-out of the analog board",
    1 << 9: "excitation current of the strain gages too large",
    1 << 8: "excitation current of the strain gages too small",
    1 << 7: "artificial analog ground out of range",
    1 << 6: "supply voltage of the analog board too high",
    1 << 5: "supply voltage of the analog board too low",
    1 << 4: "serial link data unavailable",
    1 << 3: "reference voltage error",
    1 << 2: "internal temperature error",
    1 << 1: "HTTP protocol failure",
}
"""Errors in the status word of a Net F/T, the most frequent one first."""
AXIA_STATUS = {
    1 << 30: "force or torque out of range",
    1 << 27: "strain gage out of range",
    1 << 2: "broken strain gage",
    1 << 1: "supply voltage out of range",
    1 << 0: "temperature out of range",
    1 << 29: "calibration checksum error",
    1 << 28: "simulated error",
    1 << 16: "monitor condition latched",
    1 << 5: "other error",
    1 << 3: "busy",
}
"""Errors in the status word of an Ethernet Axia, see 9620-05-C-Ethernet Axia."""


class Record(NamedTuple):
    """One record of the sensor."""

    rdt_sequence: int
    """Number of the record in its stream. The first record has the number 1."""
    ft_sequence: int
    """Number of the internal sample since the sensor was switched on."""
    status: int
    counts: tuple[int, ...]
    """Counts of the forces Fx, Fy, Fz and of the torques Tx, Ty, Tz."""


class Configuration(NamedTuple):
    """Configuration of a sensor, from its page `netftapi2.xml`."""

    product: str
    """Name of the product; empty if the page has none."""
    serial: str
    """Serial number of the active calibration."""
    counts_per_n: float
    counts_per_nm: float
    rate: float
    """Number of records per second; 0 if the page has none."""
    streams: bool
    """Whether RDT is enabled."""


def request(command: int) -> bytes:
    """Return the request with a command. A stream that it starts has no end."""
    return REQUEST.pack(HEADER, command, 0)


def decode(data: bytes) -> Record | None:
    """Return the content of a record; None if its length is wrong."""
    if len(data) != RECORD.size:
        return None
    rdt_sequence, ft_sequence, status, *counts = RECORD.unpack(data)
    return Record(rdt_sequence, ft_sequence, status, tuple(counts))


def status_text(status: int, product: str) -> str:
    """Return the errors in a status word as text; empty if there is none."""
    if not status:
        return ""
    names = AXIA_STATUS if "axia" in product.lower() else NET_FT_STATUS
    found = [name for bit, name in names.items() if status & bit]
    return ", ".join(found) or f"unknown error, status 0x{status:08x}"


def read_configuration(page: bytes) -> Configuration:
    """Return the configuration on the page `netftapi2.xml`.

    Raises
    ------
    ValueError
        The page is not that of a Net F/T, or a scale or unit is not known.
    """
    try:
        root = ElementTree.fromstring(page)
    except ElementTree.ParseError as error:
        raise ValueError(f"not the page of a Net F/T sensor: {error}") from error
    entries = {child.tag: (child.text or "").strip() for child in root}
    return Configuration(
        entries.get("prodname", ""),
        entries.get("cfgcalsn", ""),
        scale(entries, "cfgcpf", "scfgfu", FORCE_UNITS),
        scale(entries, "cfgcpt", "scfgtu", TORQUE_UNITS),
        number(entries, "comrdtrate") if "comrdtrate" in entries else 0.0,
        entries.get("comrdte", "Enabled").lower() in ("enabled", "1"),
    )


def scale(entries: Mapping[str, str], counts: str, unit: str, units: Mapping[str, float]) -> float:
    """Return the number of counts per SI unit, from the entries with these names."""
    name = "".join(letter for letter in entries.get(unit, "") if letter.isalnum())
    if name not in units:
        raise ValueError(f"{unit} is {entries.get(unit)!r}: expected one of {', '.join(units)}")
    found = number(entries, counts)
    if not 0.0 < found < math.inf:
        raise ValueError(f"{counts} is {entries[counts]!r}: expected a positive number")
    return found / units[name]


def number(entries: Mapping[str, str], name: str) -> float:
    """Return an entry as number."""
    try:
        return float(entries.get(name, ""))
    except ValueError:
        raise ValueError(f"{name} is {entries.get(name)!r}: expected a number") from None
