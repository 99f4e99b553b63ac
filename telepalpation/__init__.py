"""Name and version of the distribution, whose packages and command have other names.

The distribution `telepalpation` installs the packages `estimation`, `drivers`, `sim_backend` and
`teleop`, and the command `teleop`. Other software has packages with these names too: this package
states when Python imports one of those instead.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

__version__ = "0.2.0.dev0"
NAME = "telepalpation"
"""Name of the distribution, which `pip install` needs."""
PACKAGES = {
    "drivers": "RigError",
    "estimation": "estimation.public",
    "sim_backend": "SimulatedRig",
    "teleop": "run_trial",
}
"""The packages of the distribution, and for each a word in its `__init__.py`."""
FOLDER = Path(__file__).parents[1]
"""Folder that contains the packages."""


def needs(what: str, library: str, extra: str) -> str:
    """Return the message that something needs a library, which an extra installs."""
    return f"{what} needs {library}: expected pip install '{NAME}[{extra}]'"


def check_packages() -> None:
    """Raise ImportError if Python imports other software instead of one of the packages."""
    if problem := package_problem():
        raise ImportError(problem)


def package_problem() -> str:
    """Return which package is not that of this distribution, and what to do; empty if all are."""
    for name, word in PACKAGES.items():
        spec = find_spec(name)
        if spec is None:
            return f"the package {name} is missing in {FOLDER}: expected {repair()}"
        # a folder without code has no origin, and hides a package of an editable installation
        place = Path(spec.origin or next(iter(spec.submodule_search_locations or ())))
        own = FOLDER / name / "__init__.py"
        if place != own and place.resolve() != own.resolve():
            return (
                f"{place} hides the package {name} of {NAME} in {FOLDER}: expected another name "
                "for it, or a program in another folder"
            )
        if word not in place.read_text(encoding="utf-8", errors="replace"):
            from importlib.metadata import packages_distributions

            others = sorted({*packages_distributions().get(name, ())} - {NAME})
            by = f" by the distribution {', '.join(others)}" if others else ""
            remove = f"pip uninstall {' '.join(others)}, then " if others else ""
            return f"{place} of {NAME} was replaced{by}: expected {remove}{repair()}"
    return ""


def repair() -> str:
    """Return the command that restores the files of the packages."""
    return f"pip install --force-reinstall --no-deps {NAME}"
