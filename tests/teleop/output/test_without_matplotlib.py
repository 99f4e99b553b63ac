"""Without the extra for figures, everything else works, and a figure is refused before any work."""

from __future__ import annotations

import subprocess
import sys

import pytest

from sim_backend import SimulatedRig
from sim_backend.faults import FaultyRig, Replaced
from teleop.cli import main
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

EXPECTED = "needs matplotlib: expected pip install 'telepalpation[plot]'"


@pytest.fixture
def without(monkeypatch):
    """An installation without matplotlib."""
    for name in [*sys.modules]:
        if name.partition(".")[0] == "matplotlib" or name.endswith(("figures", "figure_style")):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setattr("teleop.files.find_spec", lambda name: None)


@pytest.mark.parametrize(
    "command",
    [
        ("run", "--clock", "virtual", "--record", "b.mcap", "--plot", "a.png"),
        ("estimate", "a.csv", "--plot", "a.png"),
        ("compare", "a.csv", "b.csv", "--plot", "a.png"),
        ("report", "a.mcap"),
        ("reproduce",),
    ],
)
def test_a_figure_is_refused_in_one_line_before_any_work(without, tmp_path, refused, command):
    assert EXPECTED in refused(*command)
    assert not [*tmp_path.iterdir()]


def test_a_trial_is_run_and_recorded_and_evaluated(without, tmp_path, capsys):
    path = str(tmp_path / "a.mcap")
    assert main(["run", "--clock", "virtual", "--duration", "2", "--record", path]) == 0
    assert main(["estimate", path, "--details"]) == 0
    assert "matplotlib" not in capsys.readouterr().out


def test_after_a_fault_only_the_figure_of_its_report_is_missing(without, tmp_path, monkeypatch):
    def broken(cube, now, **options):
        rig = FaultyRig(SimulatedRig(cube, now, **options))
        rig.inject(Replaced("master_force", 40.0))
        return rig

    monkeypatch.setattr("teleop.trial.assembly.SimulatedRig", broken)
    settings = TrialSettings("autonomous", duration=1.0, clock="virtual")
    trial = run_trial(settings, tmp_path / "a.mcap")
    assert trial.fault
    assert {path.name for path in trial.black_box.iterdir()} == {"ticks.mcap", "cause.txt"}
    assert f"channels.svg {EXPECTED}" in trial.black_box_problem


def test_a_figure_in_python_names_the_extra():
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "import numpy as np; from estimation import identify\n"
        "x = 1e-3 * np.sin(np.arange(0.0, 1.0, 1e-3) * 9.0); identify(x, 2e3 * x, 1e-3).plot()"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert ended.stderr.splitlines()[-1] == f"ModuleNotFoundError: a figure {EXPECTED}"
