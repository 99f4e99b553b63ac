"""The commands of `teleop rig` print the next command to type, complete."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from teleop.cli import app
from teleop.control.tare import Tare
from teleop.output.rig_tables import print_emulation, print_tare


def printed_command(capsys):
    """Return the arguments of the only command of teleop in the output."""
    (command,) = [text for text in capsys.readouterr().out.split(": ") if text.startswith("teleop")]
    return shlex.split(command)[1:]


def test_the_emulator_prints_a_command_that_states_specimen_and_depth(capsys):
    palpation = {"condition": "mimic", "specimen": "soft", "depth": "15.5mm", "frequency": "0.5"}
    print_emulation("board", {"usb": "/dev/pts/1"}, Path("run.toml"), palpation)
    _, bound, _ = app.parse_args(printed_command(capsys), exit_on_error=False, print_error=False)
    assert bound.arguments["trial"].rig == Path("run.toml")
    expected = {"condition": "mimic", "specimen": "soft", "depth": 15.5e-3, "frequency": 0.5}
    assert {name: getattr(bound.arguments["trial"], name) for name in palpation} == expected


@pytest.mark.parametrize("rig", [None, Path("run.toml")])
def test_the_tare_prints_a_command_with_what_the_rig_needs(capsys, rig):
    print_tare(Tare(), 0.01, 0.02, Path("tare.json"), rig)
    arguments = [word.replace("DEPTH", "3mm") for word in printed_command(capsys)]
    _, bound, _ = app.parse_args(arguments, exit_on_error=False, print_error=False)
    assert bound.arguments["trial"].tare == Path("tare.json")
    assert ("--specimen" in arguments, "--depth" in arguments) == (bool(rig), bool(rig))
