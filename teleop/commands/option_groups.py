"""Assign the options of each command to groups in its help; define the help of --estimators."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, get_type_hints

from cyclopts import Group, Parameter

GROUPS = {
    "Trial": (
        "config",
        "condition",
        "rig",
        "cube",
        "duration",
        "clock",
        "depth",
        "seed",
        "tare",
        "specimen",
        "operator",
        "notes",
        "yes",
    ),
    "Live page": ("live",),
    "Control": ("rate", "signal", "frequency", "coupling", "feedback", "channel", "realtime"),
    "Columns of a file": ("columns",),
    "Estimation": (
        "conditioning",
        "bandwidth",
        "force_lag",
        "estimators",
        "model",
        "preset",
        "whole",
        "cost",
    ),
    "Elastic modulus": ("indenter", "radius", "angle", "thickness", "poisson"),
    "Groups": ("by", "anova"),
    "Output": (
        "record",
        "no_record",
        "out",
        "plot",
        "plot_force",
        "plot_tracking",
        "plot_fit",
        "width",
        "overwrite",
        "json",
    ),
}
"""Options in each group of the help, by the title of the group, in the order of the help."""
ESTIMATORS = (
    "Names of estimators, separated by commas, or all. The message about an unknown name lists "
    "all names. Default: the estimators of the recording, and rls,ai,me for a new trial or a file "
    "of another program."
)
"""Help of the option --estimators."""


def grouped(command: Callable[..., int]) -> Callable[..., int]:
    """Assign the options of a command to their groups in the help, and return the command.

    Parameters
    ----------
    command
        Function that runs a subcommand. Its parameters are the options. An option that `GROUPS`
        does not contain remains in the group Parameters, the default group of cyclopts.
    """
    hints: dict[str, Any] = get_type_hints(command, include_extras=True)
    for place, (title, names) in enumerate(GROUPS.items()):
        group = Group(title, sort_key=place + 1)
        for name in names:
            if name not in hints:
                continue
            hints[name] = Annotated[hints[name], Parameter(group=group)]
            if name == "estimators":
                hints[name] = Annotated[hints[name], Parameter(help=ESTIMATORS)]
    command.__annotations__ = hints
    return command
