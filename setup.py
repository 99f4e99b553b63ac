"""Add the commit to packages that are built in a git checkout. All else is in pyproject.toml."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

TOP = Path(__file__).parent
sys.path.insert(0, str(TOP))  # `teleop/software.py` imports the version from `telepalpation`


def write_commit(package: Path) -> None:
    """Write the commit of this checkout to a package that is being built."""
    spec = importlib.util.spec_from_file_location("software", TOP / "teleop" / "software.py")
    assert spec
    assert spec.loader
    software = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(software)
    if commit := software.checkout_commit(TOP):
        (package / "commit.txt").write_text(f"{commit}\n")


class BuildPackages(build_py):
    """Build the packages, and write the commit to the copy of `teleop`."""

    def run(self) -> None:
        """Build as usual, then write the commit."""
        super().run()
        if not self.editable_mode:  # an editable installation asks git
            write_commit(Path(self.build_lib, "teleop"))


class BuildSource(sdist):
    """Build the source distribution, and write the commit to the copy of `teleop`."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Collect the files as usual, then write the commit."""
        super().make_release_tree(base_dir, files)
        write_commit(Path(base_dir, "teleop"))


setup(cmdclass={"build_py": BuildPackages, "sdist": BuildSource})
