"""`teleop rig list --kinds` shows the kinds of devices, also those of broken packages."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from drivers import registry
from drivers.registry import BUILT_IN
from teleop.cli import main

ROOT = Path(__file__).parents[3]
SENSOR = """
from typing import Literal
from drivers.device import DeviceSettings, SerialDevice
class GoodSettings(DeviceSettings):
    kind: Literal["good"]
    bus: str
class Good(SerialDevice):
    Settings = GoodSettings
    def signals(self):
        return {"force": "N"}
    def start(self, port): ...
    def receive(self, data, now): ...
"""
BROKEN = {
    "import no_such_module": "ModuleNotFoundError: No module named 'no_such_module'",
    "def": "SyntaxError",
    "1 / 0": "ZeroDivisionError",
    "raise SystemExit(0)": "SystemExit",
    "x = 1": "AttributeError",
    "Bad = 3": "is no class derived from Device",
    SENSOR.replace("Good(", "Bad(").replace("    def receive(", "    def received("): (
        "has no method receive"
    ),
    SENSOR.replace("Good(", "Bad(").replace("    Settings = GoodSettings\n", ""): (
        "has no class Settings"
    ),
}


@pytest.fixture
def offered(tmp_path, monkeypatch):
    """Returns a function that installs the package Acme with the kinds `good` and `bad`."""

    def install(broken, group="teleop.devices"):
        info = tmp_path / "Acme-1.5.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Name: Acme\nVersion: 1.5\n")
        points = "[teleop.devices]\ngood = good_device:Good\n"
        if group == "teleop.devices":
            points += "bad = bad_device:Bad\n"
        else:
            points += f"[{group}]\ngood = bad_device:Bad\n"
        (info / "entry_points.txt").write_text(points)
        (tmp_path / "good_device.py").write_text(SENSOR)
        (tmp_path / "bad_device.py").write_text(broken)
        monkeypatch.syspath_prepend(tmp_path)
        registry.offered.cache_clear()

    yield install
    for name in ("good_device", "bad_device"):
        sys.modules.pop(name, None)


def listed(capsys):
    assert main(["rig", "list", "--kinds", "--json"]) == 0
    return {kind["name"]: kind for kind in json.loads(capsys.readouterr().out)["kinds"]}


def test_the_kinds_of_this_package_are_listed_with_signals_and_drives(capsys):
    kinds = listed(capsys)
    assert kinds.keys() >= BUILT_IN.keys()
    assert kinds["bota"]["signals"]["fx"] == "N"
    assert kinds["bota"]["buses"] == ["serial", "tcp"]
    assert kinds["board"]["drives"] == {"axis_0": "velocity"}
    assert kinds["moteus"]["drives"] == {"axis": "velocity or force"}
    assert kinds["dbc"]["signals"] is None
    assert not kinds["reaction_force"]["emulated"]
    assert all(
        kind["package"] == "telepalpation" and not kind["problem"] for kind in kinds.values()
    )


@pytest.mark.parametrize("broken", BROKEN)
def test_a_broken_driver_is_one_line_and_does_not_hurt_the_others(capsys, offered, broken):
    offered(broken)
    kinds = listed(capsys)
    good, bad = kinds["good"], kinds["bad"]
    assert (good["package"], good["version"], good["signals"]) == ("Acme", "1.5", {"force": "N"})
    assert not good["problem"]
    assert not good["emulated"]
    assert kinds.keys() >= BUILT_IN.keys()
    assert "\n" not in bad["problem"]
    assert "Acme 1.5" in bad["problem"]
    assert BROKEN[broken] in bad["problem"]
    assert main(["rig", "list", "--kinds"]) == 0
    text = capsys.readouterr().out
    assert [line for line in text.splitlines() if line.startswith("bad (Acme 1.5): cannot be used")]


@pytest.mark.parametrize("broken", BROKEN)
def test_a_rig_file_names_a_broken_driver_in_one_line(capsys, offered, tmp_path, broken):
    offered(broken)
    example = (ROOT / "rigs" / "serial-board.toml").read_text()
    good = '[devices.other]\nkind = "good"\nbus = "other"\n'
    bus = '[buses.other]\nkind = "serial"\nport = "/dev/other"\nbaud_bps = 9600\n'
    rig = tmp_path / "rig.toml"
    rig.write_text(f'{example}\n{bus}\n{good}[devices.sensor]\nkind = "bad"\n')
    assert main(["rig", "check", str(rig)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "devices.sensor.kind" in line
    assert BROKEN[broken] in line


@pytest.mark.parametrize("broken", ["def", "import no_such_module", "Bad = 3"])
def test_a_broken_emulated_device_is_one_line(capsys, offered, broken):
    offered(broken, "teleop.emulators")
    good = listed(capsys)["good"]
    assert "bad_device:Bad" in good["problem"]
    assert "\n" not in good["problem"]
    assert good["signals"] == {"force": "N"}
