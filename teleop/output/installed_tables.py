"""Print lists of what is installed: conditions, signals, links, estimators, devices and rigs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from teleop.output.console import plain_console, terminal_width
from teleop.printable import wrapped

OPTIONS = {
    "conditions": "teleop run --condition NAME",
    "signals": "teleop run --condition autonomous --signal NAME",
    "links": "teleop run --link NAME",
    "estimators": "teleop run --estimators NAME,NAME",
    "devices": 'kind = "NAME" in a section [devices] of a rig file',
    "rigs": "teleop run --rig NAME",
}
"""How a name of each list is used."""
EMPTY = {
    "links": "none; the admittance and the coupling of the settings are used",
    "rigs": "none; the simulated rig, or a rig file, is used",
}
"""Text for an empty list."""


def print_installed(what: str, found: Sequence[Mapping[str, Any]]) -> None:
    """Print a list, with the parameters of each item under it."""
    console = plain_console()
    console.print(f"{what}: {OPTIONS[what]}", style="bold")
    if not found:
        console.print(f"  {EMPTY.get(what, 'none')}")
    widths = [max((len(one[key]) for one in found), default=0) for key in ("name", "package")]
    for one in found:
        start = f"  {one['name']:{widths[0]}}  {one['package']:{widths[1]}}  "
        text = f"cannot be used: {one['problem']}" if one["problem"] else one["description"]
        print_hanging(start, text)
        for parameter in one["parameters"]:
            print_hanging(" " * 6, parameter_text(parameter))


def parameter_text(parameter: Mapping[str, Any]) -> str:
    """Return the option that sets a parameter, with its default, unit and description."""
    default = "..." if parameter["required"] else parameter["default"]
    unit = f" [{parameter['unit']}]" if parameter["unit"] else ""
    text = f": {parameter['description']}" if parameter["description"] else ""
    return f"--set {parameter['name']}={default}{unit}{text}"


def print_hanging(start: str, text: str) -> None:
    """Print a text after a start; further lines are indented by its length."""
    width = max(terminal_width() - len(start), 20)
    lines = wrapped(text, width).splitlines() or [""]
    indented = [f"{start if not i else ' ' * len(start)}{line}" for i, line in enumerate(lines)]
    for line in indented:
        plain_console().print(line.rstrip(), highlight=False, markup=False)
