"""`teleop run --rig NAME` runs on a rig class of another package."""

from __future__ import annotations

import sys

import pytest

from drivers import registry
from teleop.cli import main
from teleop.recording.recording import load

RIG = """
from sim_backend import CUBES, SimulatedRig

class MyLab(SimulatedRig):
    def __init__(self, now):
        super().__init__(CUBES["soft"], now)
        self.rate = 3

class Incomplete(__import__("drivers").Rig):
    def open(self): ...

class NoRig: ...
"""
RUN = ["run", "--condition", "autonomous", "--duration", "0.3", "--depth", "10mm"]
SPECIMEN = ["--specimen", "silicone", "--yes", "--realtime", "off"]


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Install the package My-Lab with rig classes."""
    info = tmp_path / "My_Lab-2.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: My-Lab\nVersion: 2.1\n")
    (info / "top_level.txt").write_text("my_lab_rig\n")
    (info / "RECORD").write_text("my_lab_rig.py,,\n")
    (info / "entry_points.txt").write_text(
        "[teleop.rigs]\nmylab = my_lab_rig:MyLab\nhalf = my_lab_rig:Incomplete\n"
        "norig = my_lab_rig:NoRig\nlost = my_lab_rig:Lost\n"
    )
    (tmp_path / "my_lab_rig.py").write_text(RIG)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    registry.offered.cache_clear()
    yield tmp_path
    sys.modules.pop("my_lab_rig", None)


@pytest.mark.real_time
def test_a_rig_class_runs_a_trial_and_is_recorded(installed):
    assert main([*RUN, *SPECIMEN, "--rig", "mylab", "--record", "lab.mcap"]) in (0, 3)
    stated = load(installed / "lab.mcap").settings["custom_rig"]
    assert (stated["name"], stated["distribution"], stated["version"]) == ("mylab", "My-Lab", "2.1")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("other", "rig 'other': expected a rig file, or one of half, lost"),
        ("half", "My-Lab 2.1: my_lab_rig:Incomplete has no method close, enable, idle, read"),
        ("norig", "a rig of the package My-Lab 2.1: my_lab_rig:NoRig is no class derived from Rig"),
        ("lost", "cannot be loaded: AttributeError"),
        ("other.toml", "other.toml"),
    ],
)
@pytest.mark.usefixtures("installed")
def test_a_name_that_is_no_rig_is_refused_in_one_line(capsys, name, expected):
    assert main([*RUN, *SPECIMEN, "--rig", name]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert expected in error


@pytest.mark.parametrize(
    "command",
    [
        ["rig", "check", "mylab"],
        ["rig", "emulate", "mylab"],
        ["rig", "tare", "--rig", "mylab", "--out", "tare.json"],
    ],
    ids=lambda command: " ".join(command[:2]),
)
@pytest.mark.usefixtures("installed")
def test_a_command_that_needs_a_rig_file_refuses_a_rig_class(capsys, command):
    assert main(command) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].endswith("expected a rig file (TOML), which this command needs")
    assert "'mylab': a rig class" in lines[-1]


def test_a_path_that_exists_is_a_rig_file(installed, capsys):
    (installed / "mylab").write_text("no rig file")
    assert main([*RUN, *SPECIMEN, "--rig", "mylab"]) == 2
    assert "mylab: not a TOML file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--yes"], "expected also a specimen"),
        (["--specimen", "a", "--yes", "--clock", "virtual"], "runs in real time"),
        (["--specimen", "a"], "nobody can arm the drives"),
        (["--cube", "soft", "--yes"], "--cube"),
    ],
)
@pytest.mark.usefixtures("installed")
def test_a_rig_class_needs_what_a_hardware_rig_needs(capsys, options, expected):
    assert main([*RUN, *options, "--rig", "mylab"]) == 2
    assert expected in capsys.readouterr().err
