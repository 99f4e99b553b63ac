"""Size of an installation, and what each part adds to it: `python benchmarks/install.py`.

The wheel of this checkout is installed in a new environment with all extras. The size of an
installation with fewer extras is that of all packages which it needs: their files with bytecode,
without pip. For packages that only some users need, or that are large, the benchmark states the
size of all files that only they need, and the processor time to import them in an empty Python
process, beside one that imports numpy.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from statistics import median
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
NAME = "telepalpation"
EXTRAS = ("plot", "live", "export", "formats", "fast", "notebook", "stats", "sweep")
PARTS = {
    "matplotlib": ("matplotlib",),
    "canopen, cantools": ("canopen", "cantools"),
    "foxglove-sdk": ("foxglove-sdk",),
    "scipy": ("scipy",),
}
MODULES = {"foxglove-sdk": "foxglove"}
LIST = r"""
import importlib.metadata as metadata, json, os, re
named = lambda text: re.split(r"[^\w.-]", text, maxsplit=1)[0].lower().replace("_", "-")
found = {}
for one in metadata.distributions():
    places = map(one.locate_file, one.files or ())
    size = sum(os.path.getsize(place) for place in places if os.path.exists(place))
    needs = {}
    for text in one.requires or ():
        extra = re.search(r"extra == .(\w+)", text)
        needs.setdefault(extra[1] if extra else "", []).append(named(text))
    found[named(one.metadata["Name"])] = size, needs
print(json.dumps(found))
"""
"""Prints size and requirements of each installed distribution, as JSON."""
TIMES = 5


class Package(NamedTuple):
    """An installed package."""

    size: int
    """Size of its files [bytes]."""
    needs: dict[str, list[str]]
    """Names of the packages that it needs, by the extra; "" for those that it always needs."""


Packages = dict[str, Package]


def needed(packages: Packages, extras: Sequence[str], without: Sequence[str] = ()) -> set[str]:
    """Return the packages of an installation, if it does not need some of them."""
    reached: set[str] = set()
    waiting = [NAME, *(name for extra in extras for name in packages[NAME].needs[extra])]
    while waiting:
        name = waiting.pop()
        if name in packages and name not in reached and name not in without:
            reached.add(name)
            waiting += packages[name].needs.get("", [])
    return reached


def megabytes(packages: Packages, names: set[str]) -> float:
    """Return the size of some packages [MB]."""
    return sum(packages[name].size for name in names) / 1e6


def import_time(python: Path, modules: str) -> float:
    """Return the median processor time of a process that imports modules [s]."""
    times = []
    for _ in range(TIMES + 1):
        before = os.times()
        run(python, "-c", f"import {modules}")
        after = os.times()
        user, system = (after[i] - before[i] for i in (2, 3))  # of processes that have ended
        times.append(user + system)
    return median(times[1:])


def run(*command: object) -> str:
    """Run a command, and return what it prints."""
    ended = subprocess.run([*map(str, command)], check=True, capture_output=True, text=True)
    return ended.stdout


def main() -> None:
    print(f"# python benchmarks/install.py, {date.today()}, Python {sys.version.split()[0]}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(sys.executable, "-m", "build", "--wheel", "--outdir", folder, ROOT)
        (wheel,) = folder.glob("*.whl")
        python = folder / "environment" / "bin" / "python"
        run(sys.executable, "-m", "venv", python.parents[1])
        run(python, "-m", "pip", "install", "-q", f"{wheel}[all]")
        packages = {key: Package(*one) for key, one in json.loads(run(python, "-c", LIST)).items()}
        print("extra        packages     size")
        for title, extras in {
            "(none)": (),
            **{one: (one,) for one in EXTRAS},
            "all": EXTRAS,
        }.items():
            found = needed(packages, extras)
            print(f"{title:12} {len(found):8} {megabytes(packages, found):5.0f} MB")
        print("\npart               packages     size   import    numpy")
        for part, names in PARTS.items():
            only = needed(packages, EXTRAS) - needed(packages, EXTRAS, names)
            modules = ", ".join(MODULES.get(one, one) for one in names)
            times = import_time(python, modules), import_time(python, "numpy")
            print(
                f"{part:18} {len(only):8} {megabytes(packages, only):5.1f} MB"
                f" {times[0]:6.2f} s {times[1]:6.2f} s"
            )


if __name__ == "__main__":
    main()
