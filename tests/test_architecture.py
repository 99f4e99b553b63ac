"""Imports go only in the directions that CONTRIBUTING.md states."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import estimation

ROOT = Path(__file__).parents[1]
ALLOWED = {
    "telepalpation": {"teleop"},
    "estimation": {"telepalpation", "numpy", "scipy", "numba", "pandas", "matplotlib"},
    "drivers": {
        "telepalpation",
        *("hypothesis", "numpy", "serial", "can", "pydantic"),
        *("canopen", "cantools", "websockets"),
    },
    "sim_backend": {"drivers", "numpy", "scipy", "pydantic", "can", "cantools", "tomlkit"},
    "teleop": {
        "telepalpation",
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
        "jinja2",
        "markupsafe",
        "pydantic",
        "pydantic_core",
        "pandas",
        "statsmodels",
        "tomlkit",
        "websockets",
        "h5py",
        "pyarrow",
        "zstandard",
        "nptdms",
        "python_calamine",
        "rosbags",
        "mcap_ros2",
        "distributed",
    },
}
ROOMS = {
    "safety": set(),
    "control": {"safety"},
    "streams": {"safety", "control"},
    "live": {"safety", "streams"},
    "recording": {"safety", "streams", "live"},
    "evaluation": {"streams", "recording"},
    "settings": {"safety", "control", "recording"},
    "station": {"safety", "control", "settings"},
    "output": {"safety", "control", "streams", "recording", "evaluation", "settings"},
    "trial": {
        *("safety", "control", "streams", "live", "recording"),
        *("evaluation", "output", "settings", "station"),
    },
    "rig": {"safety", "control", "streams", "recording", "settings", "trial"},
    "studies": {
        *("safety", "control", "recording", "evaluation"),
        *("output", "settings", "trial"),
    },
    "commands": {
        *("safety", "control", "streams", "live", "recording"),
        *("evaluation", "output", "settings", "trial", "rig", "station", "studies"),
    },
}
"""The rooms of `teleop`, and those that each may import from."""
FLAT = {
    "__init__",
    "__main__",
    "cli",
    "errors",
    "failures",
    "files",
    "interruption",
    "json_documents",
    "names",
    "software",
    "printable",
    "rig_session",
    "testing",
    "vibration",
}
"""Modules of `teleop` outside the rooms."""
OUTERMOST = {"teleop.cli", "teleop.__main__", "teleop.rig_session", "teleop.testing"}
"""Modules that may import from every room, and that no other module imports."""
POSIX_ONLY = {"fcntl", "termios", "pty", "resource", "grp", "pwd", "posix", "syslog", "tty"}


@cache
def parsed(path: Path) -> ast.Module:
    """Return the syntax tree of a file, which is parsed once for all tests."""
    return ast.parse(path.read_text())


def imported(path: Path, lazily: bool = True) -> set[str]:
    """Return the packages that a module imports, with or without imports within functions."""
    names: set[str] = set()
    tree = parsed(path)
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


def test_only_one_module_imports_what_only_posix_systems_have():
    for package in ALLOWED:
        for path in sorted((ROOT / package).rglob("*.py")):
            assert not imported(path) & POSIX_ONLY, path
            assert "os.name" not in path.read_text(), path


def modules() -> dict[str, Path]:
    """Return the files of the four packages by the name of their module."""
    files = (path for package in ALLOWED for path in (ROOT / package).rglob("*.py"))
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in files
    }


def at_run_time(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a syntax tree without those that only a type checker sees."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        yield node
        yield from at_run_time(node)


@cache
def imports_between_files(types: bool = True) -> dict[str, set[str]]:
    """Return the modules that each module imports, also within functions.

    If `types` is False, imports that only a type checker sees are left out.
    """
    known = modules()
    arrows: dict[str, set[str]] = {}
    for name, path in known.items():
        found = set()
        for node in ast.walk(parsed(path)) if types else at_run_time(parsed(path)):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                submodules = {f"{node.module}.{alias.name}" for alias in node.names}
                found |= submodules & known.keys() or {node.module}
        arrows[name] = found & known.keys() - {name}
    return arrows


def room(module: str) -> str:
    """Return the room of a module of `teleop`; empty for a module outside the rooms."""
    _, _, rest = module.partition("teleop.")
    first = rest.partition(".")[0]
    return first if first in ROOMS else ""


def test_no_files_import_each_other_in_a_circle_at_run_time():
    order = TopologicalSorter(imports_between_files(types=False))
    try:
        order.prepare()
    except CycleError as error:
        pytest.fail(" <- ".join(error.args[1]))


def test_rooms_import_only_from_the_rooms_that_the_plan_allows():
    for name, imported_names in imports_between_files().items():
        if here := room(name):
            others = {room(other) for other in imported_names} - {"", here}
            assert others <= ROOMS[here], name
        elif name.startswith("teleop.") and name not in OUTERMOST:
            assert not any(room(other) for other in imported_names), name


def reached(module: str) -> set[str]:
    """Return the modules that a module imports at run time, directly or through other modules."""
    arrows, found, new = imports_between_files(types=False), set(), {module}
    while new:
        found |= new
        new = {other for name in new for other in arrows[name]} - found
    return found


@pytest.mark.parametrize("here", ["safety", "control"])
def test_the_simulator_is_not_on_the_path_of_a_real_rig(here):
    inside = [name for name in modules() if room(name) == here]
    assert inside
    for name in inside:
        assert not {other for other in reached(name) if other.startswith("sim_backend")}, name


def test_only_the_named_modules_of_teleop_are_outside_the_rooms():
    assert {path.stem for path in (ROOT / "teleop").glob("*.py")} == FLAT
    folders = {path.name for path in (ROOT / "teleop").iterdir() if (path / "__init__.py").exists()}
    assert folders == set(ROOMS)


def test_only_the_controller_commands_a_rig_so_that_the_supervisor_sees_every_motion():
    commanding = {
        path.name
        for path in (ROOT / "teleop").rglob("*.py")
        if re.search(r"rig\.(write|enable)\(", path.read_text())
    }
    assert commanding == {"controller.py", "pausable_rig.py"}


def test_no_public_name_of_estimation_is_the_name_of_one_of_its_modules():

    assert not set(estimation.__all__) & {path.stem for path in (ROOT / "estimation").iterdir()}


def test_the_public_names_of_estimation_are_listed_for_completion():
    assert {"identify", "Bank", "RecursiveLeastSquares"} <= set(dir(estimation))
