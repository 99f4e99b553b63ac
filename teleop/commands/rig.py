"""`teleop rig`: the commands list, check, emulate and tare, with which a rig is set up."""

from __future__ import annotations

from cyclopts import App

from teleop.commands.options import Json
from teleop.commands.rig_check import check
from teleop.commands.rig_emulate import emulate
from teleop.commands.rig_tare import tare

rig = App(
    name="rig",
    help="Set up a rig: list ports, check or emulate its devices, measure its zero offsets.",
)


@rig.command(name="list")
def list_(*, json: Json = False) -> int:
    """List the serial ports and CAN buses of this machine.

    Devices on a network cannot be listed. Their address is given in the rig file.

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


for command in (check, emulate, tare):
    rig.command(command)
