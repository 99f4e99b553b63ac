"""Compiled code is stored once, also where the installation cannot be written."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import estimation

pytest.importorskip("numba", reason="needs the `fast` extra")
SCRIPT = """
import numpy as np
from estimation import METHODS, paper_preset
from estimation.compiled import choice, compiled
choice.is_compiled = lambda samples: True
n = np.arange(1.0, 100.0)
estimator = METHODS["reference"](paper_preset("soft"))
print(estimator.run(n, n % 7, n, 1e-3).k[-1] > 0.0)
stats = compiled(type(estimator).step, 2).stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


@pytest.fixture
def read_only(tmp_path):
    """A copy of the package whose caches of bytecode are files, so that none can be written."""
    package = tmp_path / "installed" / "estimation"
    source = Path(estimation.__file__).parent
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in (package, *(path for path in package.rglob("*") if path.is_dir())):
        (folder / "__pycache__").touch()
    return package.parent


def run(folder, home):
    environment = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR",)}
    environment |= {"PYTHONPATH": str(folder), "HOME": str(home), "XDG_CACHE_HOME": str(home)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_a_read_only_installation_stores_compiled_code_in_the_cache_of_the_user(
    read_only, tmp_path
):
    home = tmp_path / "home"
    home.mkdir()
    assert run(read_only, home) == ["True", "0", "1"]
    assert run(read_only, home) == ["True", "1", "0"]


def test_code_is_compiled_although_no_cache_can_be_written(read_only, tmp_path):
    home = tmp_path / "home"
    home.touch()
    assert run(read_only, home)[0] == "True"
