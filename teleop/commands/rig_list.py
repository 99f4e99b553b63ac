"""`teleop rig list`: the ports and buses that this machine has."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter


def list_(*, json: Annotated[bool, Parameter(negative="")] = False) -> int:
    """Show the serial ports and CAN buses that this machine has.

    Example: `teleop rig list`

    Parameters
    ----------
    json
        Print one JSON document instead of a table.
    """
    from drivers.ports import found
    from teleop.output import rig_tables as rig_console
    from teleop.output import tables as console

    ports = found()
    if json:
        console.print_json({"ports": [port._asdict() for port in ports]})
    else:
        rig_console.print_ports(ports)
    return 0
