"""Define the units of time, position and force, and their spellings in measurement files."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

UNITS = {
    "time": {
        "s": 1.0,
        "ms": 1e-3,
        "us": 1e-6,
        "µs": 1e-6,
        "ns": 1e-9,
        "min": 60.0,
        "h": 3600.0,
    },
    "position": {
        "m": 1.0,
        "cm": 1e-2,
        "mm": 1e-3,
        "um": 1e-6,
        "µm": 1e-6,
        "nm": 1e-9,
        "in": 25.4e-3,
    },
    "force": {
        "N": 1.0,
        "mN": 1e-3,
        "kN": 1e3,
        "gf": 9.80665e-3,
        "kgf": 9.80665,
        "lbf": 4.4482216152605,
        "cN": 1e-2,
        "uN": 1e-6,
        "nN": 1e-9,
        "µN": 1e-6,
    },
}
"""Units of each quantity, with the size of each unit in SI units."""

OPTION_UNITS = {
    **UNITS,
    "frequency": {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3},
    "angle": {"deg": math.pi / 180.0, "rad": 1.0, "mrad": 1e-3},
    "stiffness": {"N/m": 1.0, "N/mm": 1e3, "kN/m": 1e3},
    "compliance": {"m/N": 1.0, "mm/N": 1e-3, "um/N": 1e-6, "µm/N": 1e-6},
}
"""Units of each quantity that command options accept, with the size of each unit in SI units."""

ON_LEVER = {
    "time": {},
    "position": {"deg": math.pi / 180.0, "rad": 1.0, "mrad": 1e-3},
    "force": {"N m": 1.0, "mN m": 1e-3, "N mm": 1e-3, "N cm": 1e-2, "kN m": 1e3},
}
"""Units of angle [rad] and torque [N m], which a lever arm converts to position and force."""

SPELLINGS = {
    "s": "sec secs second seconds sek sekunden 秒",
    "ms": "msec msecs millisecond milliseconds 毫秒",
    "us": "usec microsecond microseconds",
    "min": "mins minute minutes 分",
    "h": "hr hour hours",
    "m": "meter meters metre metres",
    "mm": "millimeter millimeters millimetre millimetres 毫米",
    "um": "micron microns micrometer micrometers micrometre micrometres",
    "in": "inch inches",
    "N": "newton newtons 牛 牛顿",
    "gf": "g gram grams gram-force",
    "kgf": "kg kp kilogram kilograms",
    "kN": "千牛",
    "lbf": "lb lbs pound pounds",
    "deg": "° degree degrees grad",
    "rad": "radian radians",
}
"""Other spellings of each unit, in upper or lower case. For a force, g and kg mean gf and kgf."""
CANONICAL = {other: unit for unit, others in SPELLINGS.items() for other in others.split()}

MICRO, GREEK_MU = "\u00b5", "\u03bc"
"""The micro sign and the Greek letter mu, which look the same but are two Unicode characters."""

LARGEST = 1e12
"""Largest absolute value of a time, position or force in SI units. A larger value is an error."""
SMALLEST = 1e-20
"""Smallest range of a position or force in SI units. With a smaller one, squares would be zero."""


class Size(NamedTuple):
    """Conversion of a unit of a measurement file to SI units."""

    scale: float
    """Factor that converts a value in this unit to SI units."""
    on_lever: bool
    """Whether the unit is a unit of angle [rad] or torque [N m], for which a lever arm is
    needed."""


def canonical(unit: str) -> str:
    """Return a unit in the spelling that this module uses.

    For example, the result is `s` for `sec`, and `N m` for `Nm`.
    """
    unit = unit.strip().replace(GREEK_MU, MICRO)
    torque = re.fullmatch(r"([mk]?N)[\s.·*-]?(m|mm|cm)", unit)
    if torque:
        return f"{torque[1]} {torque[2]}"
    return CANONICAL.get(unit.casefold().rstrip("."), unit)


def size_of(unit: str, kind: str) -> Size | None:
    """Return the factor that converts a unit to SI units, as a `Size`.

    The result is None if `unit` is not a unit of the quantity `kind`. Units of angle and torque
    count as units of position and force, because a lever arm converts them.
    """
    unit = canonical(unit)
    if unit in UNITS[kind]:
        return Size(UNITS[kind][unit], False)
    if unit in ON_LEVER[kind]:
        return Size(ON_LEVER[kind][unit], True)
    return None


def is_unit(text: str) -> bool:
    """Return whether a text is a known unit of time, position, force, angle or torque."""
    return any(size_of(text, kind) for kind in UNITS)


NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.]+)")


def quantity(text: str, kind: str) -> float | None:
    """Convert a text such as 1.5mm, which is a number with a unit, to a number in SI units.

    The result is None if the text is not a number with a unit of the quantity `kind`, or if the
    absolute value is not below `LARGEST`.
    """
    match = NUMBER.fullmatch(text.strip().replace(GREEK_MU, MICRO))
    if not match or match[2] not in OPTION_UNITS[kind]:
        return None
    value = float(match[1]) * OPTION_UNITS[kind][match[2]]
    return value if abs(value) < LARGEST else None
