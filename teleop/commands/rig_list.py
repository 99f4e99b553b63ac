"""`teleop rig list`: list the serial ports and CAN buses of this machine."""

from __future__ import annotations

from teleop.commands.options import Json


def list_(*, json: Json = False) -> int:
    """List the serial ports and CAN buses of this machine.

    Example: `teleop rig list`
    """
    from drivers.ports import available_ports
    from teleop.output import console, rig_tables

    ports = available_ports()
    if json:
        console.print_json({"ports": [port._asdict() for port in ports]})
    else:
        rig_tables.print_ports(ports)
    return 0
