"""Convert the recorded settings of a trial to rows of a table, with rounded values and units."""

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
"""Text that a recording contains instead of an infinite limit."""
DIGITS = 5
"""Number of significant digits to which a value is rounded."""


def settings_rows(settings: Mapping[str, Any], start: str = "") -> Iterator[tuple[str, str]]:
    """Yield the name and the value, as texts, of each recorded setting that has a value.

    A setting that is None, an empty text or an empty list is omitted. If a setting is a dictionary
    of further settings, each of these is yielded. A dot then joins the names, for example in
    `limits.max_velocity`.
    """
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from settings_rows(value, f"{start}{name}.")
        elif value is not None and value not in ("", [], ()):
            yield f"{start}{name}", f"{value_text(value)} {unit_of(name, value)}".rstrip()


def value_text(value: Any) -> str:
    """Return the value of a setting as text.

    A `float` is rounded to `DIGITS` significant digits, or to an integer if the integer has more
    digits.
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{DIGITS}g}" if abs(value) < 10.0**DIGITS else f"{value:.0f}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(value_text, value))
    return "no limit" if value == INFINITE else str(value)


def unit_of(name: str, value: Any) -> str:
    """Return the unit of a setting; an empty text if it has none.

    The unit follows from the name of the setting (see `UNITS` and `SUFFIXES`). A value that is
    neither a number nor a list of numbers has no unit.
    """
    first = value[0] if isinstance(value, list | tuple) else value
    if not isinstance(first, int | float) or isinstance(first, bool):
        return ""
    suffixes = (unit for end, unit in SUFFIXES.items() if name.endswith(end))
    return UNIT_OF.get(name, next(suffixes, ""))
