"""`teleop rig`: the commands with which a rig is set up."""

from __future__ import annotations

from typing import Annotated

from cyclopts import App, Parameter

from teleop.commands.options import Json
from teleop.commands.rig_check import check
from teleop.commands.rig_emulate import emulate
from teleop.commands.rig_new_driver import new_driver
from teleop.commands.rig_report import report
from teleop.commands.rig_tare import tare

rig = App(
    name="rig",
    help=(
        "Set up a rig: list ports, check or emulate its devices, measure its zero offsets, report "
        "about it, write a driver."
    ),
)


@rig.command(name="list")
def list_(
    *,
    kinds: Annotated[
        bool, Parameter(help="List the kinds of devices that a rig file can contain instead.")
    ] = False,
    json: Json = False,
) -> int:
    """List the serial ports and CAN buses of this machine, or the kinds of devices.

    Devices on a network cannot be listed. Their address is given in the rig file.

    Example: `teleop rig list`
    """
    from teleop.output import console, rig_tables

    if kinds:
        from teleop.rig.kinds import all_kinds

        found = all_kinds()
        if json:
            console.print_json({"kinds": [kind._asdict() for kind in found]})
        else:
            rig_tables.print_kinds([kind._asdict() for kind in found])
        return 0

    from drivers.ports import available_ports

    ports = available_ports()
    if json:
        console.print_json({"ports": [port._asdict() for port in ports]})
    else:
        rig_tables.print_ports(ports)
    return 0


for command in (check, report, emulate, tare, new_driver):
    rig.command(command)
