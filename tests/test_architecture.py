"""No import arrow runs against the plan of the house, DESIGN.md."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ALLOWED = {
    "estimation": {"numpy", "scipy", "numba", "pandas", "matplotlib"},
    "drivers": {"numpy", "serial", "can", "pydantic", "canopen", "cantools"},
    "sim_backend": {"drivers", "numpy", "scipy", "can", "cantools", "tomlkit"},
    "teleop": {
        "estimation",
        "drivers",
        "sim_backend",
        "numpy",
        "scipy",
        "rich",
        "cyclopts",
        "matplotlib",
        "foxglove",
        "lz4",
        "mcap",
        "pydantic",
        "h5py",
        "pyarrow",
        "zstandard",
        "nptdms",
        "python_calamine",
        "rosbags",
        "mcap_ros2",
    },
}
POSIX_ONLY = {"fcntl", "termios", "pty", "resource", "grp", "pwd", "posix", "syslog", "tty"}


def imported(path: Path, lazily: bool = True) -> set[str]:
    """Packages that a module imports, those within its functions included or not."""
    names: set[str] = set()
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree) if lazily else tree.body:
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.partition(".")[0])
    return names


@pytest.mark.parametrize("package", ALLOWED)
def test_a_package_imports_only_what_the_plan_allows(package):
    files = sorted((ROOT / package).rglob("*.py"))
    assert files
    for path in files:
        foreign = imported(path) - set(sys.stdlib_module_names) - {package}
        assert foreign <= ALLOWED[package], path


@pytest.mark.parametrize("package", ALLOWED)
def test_no_module_needs_posix_to_be_imported(package):
    for path in sorted((ROOT / package).rglob("*.py")):
        assert not imported(path, lazily=False) & POSIX_ONLY, path


def test_only_the_controller_commands_a_rig_so_that_the_supervisor_sees_every_motion():
    commanding = {
        path.name
        for path in (ROOT / "teleop").rglob("*.py")
        if re.search(r"rig\.(write|enable)\(", path.read_text())
    }
    assert commanding == {"controller.py", "pausable_rig.py"}
