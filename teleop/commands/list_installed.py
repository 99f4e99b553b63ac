"""`teleop list`: what is installed, and from which package."""

from __future__ import annotations

from typing import Literal

from teleop.commands.options import Json


def list_installed(
    what: Literal["conditions", "signals", "links", "estimators", "devices", "rigs"] | None = None,
    /,
    *,
    json: Json = False,
) -> int:
    """List the installed conditions, signals, links, estimators, devices and rigs.

    Other packages can provide them. A package that cannot be used is listed with the reason.

    Example: `teleop list conditions`

    Parameters
    ----------
    what
        What to list. Default: everything.
    """
    from teleop.output.console import print_json
    from teleop.output.installed_tables import print_installed
    from teleop.settings.installed import LISTS, installed

    found = {
        str(name): [one._asdict() for one in installed(name)]
        for name in ([what] if what else LISTS)
    }
    if json:
        print_json(found)
        return 0
    for i, (name, rows) in enumerate(found.items()):
        if i:
            print()
        print_installed(name, rows)
    return 0
