"""The rows of a table of recorded settings: rounded values with units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

SUFFIXES = {"_hz": "Hz", "_s": "s", "_m": "m"}
"""Unit of a setting, by the end of its name."""
UNITS = {
    "m": ("soft_position", "hard_position", "following_error", "depth", "lost_motion"),
    "m/s": ("max_velocity", "max_master_velocity", "rest_velocity"),
    "m/s^2": ("max_acceleration", "max_master_acceleration"),
    "m/N": ("drive_compliance", "compliance"),
    "N": ("soft_force", "hard_force", "rest_master_force", "force_noise"),
    "s": ("preflight", "start_ramp", "max_gap", "max_age", "frozen_time", "force_lag"),
    "kg": ("mass",),
    "N s/m": ("damping",),
    "N/m": ("stiffness", "arm_stiffness"),
}
"""Names of settings without a unit in their name, by their unit."""
UNIT_OF = {name: unit for unit, names in UNITS.items() for name in names}
"""Unit of a setting, by its name."""
INFINITE = "Infinity"
"""A limit that is infinite, as the JSON of a recording contains it."""
DIGITS = 5
"""Number of significant digits of a value."""


def settings_rows(settings: Mapping[str, Any], start: str = "") -> Iterator[tuple[str, str]]:
    """Yield name and value of each setting that is set; dots join the names of nested settings.

    Settings without a value are omitted: None, an empty text and an empty list.
    """
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from settings_rows(value, f"{start}{name}.")
        elif value is not None and value not in ("", [], ()):
            yield f"{start}{name}", f"{value_text(value)} {unit_of(name, value)}".rstrip()


def value_text(value: Any) -> str:
    """Return a value as text; numbers are rounded to `DIGITS` significant digits."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{DIGITS}g}" if abs(value) < 10.0**DIGITS else f"{value:.0f}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(value_text, value))
    return "no limit" if value == INFINITE else str(value)


def unit_of(name: str, value: Any) -> str:
    """Return the unit of a setting; empty if it has none, or if the value is not a number."""
    first = value[0] if isinstance(value, list | tuple) else value
    if not isinstance(first, int | float) or isinstance(first, bool):
        return ""
    suffixes = (unit for end, unit in SUFFIXES.items() if name.endswith(end))
    return UNIT_OF.get(name, next(suffixes, ""))
