"""Options for quantities: each accepts a number with a unit."""

from __future__ import annotations

import json
import math
import re
from typing import get_args

import pytest
from cyclopts import App, Token

from teleop.cli import app, main
from teleop.commands.quantities import EXAMPLES, in_si
from teleop.control.channel import ChannelSettings, parse_channel
from teleop.errors import InputError

NO_QUANTITIES = {"--poisson"}
"""Options for numbers without a dimension."""


def float_options(parent: App) -> set[tuple[str, bool]]:
    """Return each option for a number, and whether it has a converter, of all commands."""
    found = set()
    for name, command in parent.resolved_commands().items():
        if name.startswith("-"):
            continue
        if command.default_command:
            for argument in command.assemble_argument_collection():
                if float in (argument.hint, *get_args(argument.hint)):
                    found.add((argument.name, argument.parameter.converter is not None))
        found |= float_options(command)
    return found


def test_every_option_for_a_quantity_accepts_a_unit():
    options = float_options(app)
    assert {"--depth", "--force-lag", "--rate", "--seconds", "--angle"} <= dict(options).keys()
    assert {name for name, converts in options if not converts} == NO_QUANTITIES


def run(capsys, *options):
    assert main(["run", "--clock", "virtual", "--no-record", "--json", *options]) == 0
    return json.loads(capsys.readouterr().out)["estimates"]


def test_a_quantity_with_its_unit_is_that_in_si_units(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plain = ("--duration", "0.5", "--force-lag", "0.002", "--bandwidth", "25", "--rate", "500")
    units = ("--duration", "500ms", "--force-lag", "2 ms", "--bandwidth", "0.025kHz")
    assert run(capsys, *plain) == run(capsys, *units, "--rate", "0.5 kHz")


@pytest.mark.parametrize(
    ("option", "text", "expected"),
    [
        ("--force-lag", "5mm", "expected a time with its unit, such as 5ms, or a number in s"),
        ("--bandwidth", "20s", "expected a frequency with its unit, such as 20Hz, or a number"),
        (
            "--depth",
            "5",
            "expected a length with its unit, such as 5mm, or a number in m up to 0.5",
        ),
        ("--duration", "ten", "expected a time"),
    ],
)
def test_a_quantity_with_another_unit_is_refused_in_one_line(refused, option, text, expected):
    assert f"{option} '{text}': {expected}" in refused("run", option, text)


def test_a_number_without_a_unit_is_in_si_units_in_every_option_for_a_quantity():
    for kind in EXAMPLES:
        assert in_si(kind)(None, [Token(keyword="--option", value="1e-4")]) == 1e-4, kind


@pytest.mark.parametrize(
    ("kind", "text"), [("position", "5"), ("angle", "30"), ("compliance", "7"), ("time", "inf")]
)
def test_a_number_that_is_probably_not_in_si_units_is_refused(kind, text):
    with pytest.raises(InputError, match=re.escape(f"'{text}': expected a")):
        in_si(kind)(None, [Token(keyword="--option", value=text)])


def test_the_times_of_a_channel_follow_the_same_rule(refused):
    assert parse_channel("delay=0.05,jitter=2ms") == ChannelSettings(0.05, 0.002)
    end = "expected a time with its unit, such as 5ms, or a number in s\n"
    assert refused("run", "--feedback", "position-force", "--channel", "delay=5mm").endswith(end)
    assert refused("run", "--force-lag", "5mm").endswith(end)


def test_the_dimensions_of_an_indenter_have_units(capsys, tmp_path):
    path = tmp_path / "spring.csv"
    rows = [(i * 1e-2, 4.0 - 3.0 * math.cos(i * 0.06)) for i in range(600)]
    lines = (f"{t},{x},{2.0 * x + 0.01 * math.sin(1e3 * t)}\n" for t, x in rows)
    path.write_text("Time [s],Position [mm],Force [N]\n" + "".join(lines))
    moduli = []
    for radius, thickness in (("0.005", "0.02"), ("5mm", "2cm")):
        options = ["--indenter", "flat", "--radius", radius, "--thickness", thickness, "--json"]
        assert main(["estimate", str(path), *options]) == 0
        moduli.append(json.loads(capsys.readouterr().out)["material"])
    assert moduli[0] == moduli[1]
