"""`teleop rig`: the commands list, check, emulate and tare, with which a rig is set up."""

from __future__ import annotations

from cyclopts import App

from teleop.commands.rig_check import check
from teleop.commands.rig_emulate import emulate
from teleop.commands.rig_list import list_
from teleop.commands.rig_tare import tare

rig = App(
    name="rig",
    help="Set up a rig: list ports, check or emulate its devices, measure its zero offsets.",
)
rig.command(list_, name="list")
for command in (check, emulate, tare):
    rig.command(command)
