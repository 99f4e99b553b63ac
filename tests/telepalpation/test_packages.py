"""Other software with a package of the same name is named, and what to do is stated."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

import telepalpation
from telepalpation import FOLDER, PACKAGES, needs, package_problem

OTHER = '"""Drivers of a laboratory."""\n'


def script(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a script, whose folder is the first that Python searches for packages."""
    (folder / "script.py").write_text("from teleop import Rig")
    asked = [sys.executable, folder / "script.py"]
    env = {**os.environ, "PYTHONPATH": str(FOLDER)}
    return subprocess.run(asked, capture_output=True, text=True, check=False, env=env)


@pytest.mark.parametrize("name", ["drivers/__init__.py", "drivers.py"])
def test_a_script_beside_other_drivers_is_told_which_file_hides_ours(tmp_path, name):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text(OTHER)
    ended = script(tmp_path)
    assert ended.returncode == 1
    line = ended.stderr.splitlines()[-1]
    assert line.startswith(f"ImportError: {tmp_path / name} hides the package drivers of telepalp")
    assert str(FOLDER) in line


def test_a_folder_without_code_beside_a_script_hides_nothing(tmp_path):
    (tmp_path / "drivers").mkdir()
    (tmp_path / "drivers" / "notes.txt").touch()
    assert script(tmp_path).returncode == 0


def test_a_folder_without_code_that_hides_a_package_is_named(monkeypatch, tmp_path):
    spec = ModuleSpec("drivers", None, is_package=True)
    spec.submodule_search_locations = [str(tmp_path / "drivers")]
    monkeypatch.setattr(telepalpation, "find_spec", lambda name: spec)
    assert package_problem().startswith(f"{tmp_path / 'drivers'} hides the package drivers of")


@pytest.fixture
def installed(tmp_path):
    """A folder with the packages, as pip installs them, without the modules within them."""
    for name in ("telepalpation", *PACKAGES):
        shutil.copytree(
            FOLDER / name,
            tmp_path / name,
            ignore=lambda folder, names: {*names} - {"__init__.py", "__main__.py"},
        )
    return tmp_path


def command(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the command of the distribution in a folder, without other installed packages."""
    code = "import sys; sys.path.insert(0, sys.argv[1])\nfrom telepalpation.__main__ import main\n"
    asked = [sys.executable, "-I", "-S", "-c", f"{code}sys.exit(main())", folder]
    return subprocess.run(asked, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_that_another_distribution_replaced_is_named_by_the_command(installed, name):
    (installed / name / "__init__.py").write_text("raise SystemExit('the other software')\n")
    about = installed / "robotarm-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: robotarm\nVersion: 1.0\n")
    (about / "RECORD").write_text(f"{name}/__init__.py,,\n")
    ended = command(installed)
    assert ended.returncode == 2
    (line,) = ended.stderr.splitlines()
    assert f"{name}/__init__.py of telepalpation was replaced by the distribution robotarm" in line
    assert line.endswith(
        "expected pip uninstall robotarm, then "
        "pip install --force-reinstall --no-deps telepalpation"
    )


def test_a_package_that_is_missing_is_named_by_the_command(installed):
    shutil.rmtree(installed / "estimation")
    ended = command(installed)
    assert ended.returncode == 2
    assert "the package estimation is missing" in ended.stderr


def test_the_packages_of_this_checkout_are_its_own():
    assert package_problem() == ""


def test_the_package_is_run_as_the_command():
    asked = [sys.executable, "-m", "telepalpation", "--version"]
    ended = subprocess.run(asked, capture_output=True, text=True, check=True)
    assert ended.stdout.startswith(telepalpation.__version__)


def test_a_missing_extra_is_named_with_the_distribution():
    expected = "a report needs matplotlib: expected pip install 'telepalpation[plot]'"
    assert needs("a report", "matplotlib", "plot") == expected


def test_every_message_about_an_extra_is_made_by_one_function():
    stated = re.compile(r"pip install.{0,20}\[")
    files = [path for name in PACKAGES for path in (FOLDER / name).rglob("*.py")]
    assert [path.name for path in files if stated.search(path.read_text())] == ["export.py"]
