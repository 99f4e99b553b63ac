"""Size of an installation, and what each part adds to it: `python benchmarks/install.py`.

The wheel of this checkout is installed in new environments, without extras and with each extra. The
sizes are those of all files of the installed packages with their bytecode, without pip. For the
packages that could be left out of the core, the benchmark states the size of all files that only
they need, and the time to import them in an empty Python process, in turn with one that imports
numpy.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from statistics import median

ROOT = Path(__file__).parents[1]
EXTRAS = ("", "plot", "live", "export", "formats", "fast", "notebook", "stats", "sweep", "all")
PARTS = {
    "matplotlib": ("matplotlib",),
    "canopen, cantools": ("canopen", "cantools"),
    "foxglove-sdk": ("foxglove-sdk",),
    "scipy": ("scipy",),
}
"""Packages that only some users need, or that are large."""
MODULES = {"foxglove-sdk": "foxglove"}
LIST = """
import importlib.metadata as metadata, json, os, re
named = lambda text: re.split(r"[^\\w.-]", text, maxsplit=1)[0].lower().replace("_", "-")
found = {}
for one in metadata.distributions():
    places = map(one.locate_file, one.files or ())
    size = sum(os.path.getsize(place) for place in places if os.path.exists(place))
    needed = [named(text) for text in one.requires or () if "extra ==" not in text]
    found[named(one.metadata["Name"])] = size, needed
print(json.dumps(found))
"""
"""Prints size and requirements of each installed distribution, as JSON."""
TIMES = 5


def installed(python: Path) -> dict[str, tuple[int, list[str]]]:
    """Return size [bytes] and requirements of the packages in an environment, without pip."""
    printed = subprocess.run([python, "-c", LIST], check=True, capture_output=True, text=True)
    found = json.loads(printed.stdout)
    return {name: about for name, about in found.items() if name not in ("pip", "setuptools")}


def needed(packages: dict[str, tuple[int, list[str]]], without: Sequence[str] = ()) -> set[str]:
    """Return the packages that core and figures need, if they do not need some of them."""
    reached: set[str] = set()
    waiting = ["telepalpation", "matplotlib"]
    while waiting:
        name = waiting.pop()
        if name in packages and name not in reached and name not in without:
            reached.add(name)
            waiting += packages[name][1]
    return reached


def megabytes(packages: dict[str, tuple[int, list[str]]], names: set[str]) -> float:
    """Return the size of some packages [MB]."""
    return sum(packages[name][0] for name in names) / 1e6


def import_time(python: Path, module: str) -> float:
    """Return the median time of a process that imports a module [s]."""
    times = []
    for _ in range(TIMES + 1):
        begin = time.perf_counter()
        subprocess.run([python, "-c", f"import {module}"], check=True)
        times.append(time.perf_counter() - begin)
    return median(times[1:])


def main() -> None:
    print(f"# python benchmarks/install.py, {date.today()}, Python {sys.version.split()[0]}")
    print("extra        packages     size")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(sys.executable, "-m", "build", "-q", "--wheel", "--outdir", folder, ROOT)
        (wheel,) = folder.glob("*.whl")
        for extra in EXTRAS:
            python = folder / f"with-{extra}" / "bin" / "python"
            run(sys.executable, "-m", "venv", python.parents[1])
            run(python, "-m", "pip", "install", "-q", f"{wheel}[{extra}]" if extra else wheel)
            packages = installed(python)
            size = megabytes(packages, set(packages))
            print(f"{extra or '(none)':12} {len(packages):8} {size:5.0f} MB", flush=True)
        print("\npart               packages     size  import, and numpy")
        for part, names in PARTS.items():
            only = needed(packages) - needed(packages, names)
            modules = ", ".join(MODULES.get(name, name) for name in names)
            both = import_time(python, modules), import_time(python, "numpy")
            print(
                f"{part:18} {len(only):8} {megabytes(packages, only):5.1f} MB "
                f"{both[0]:6.2f} s {both[1]:6.2f} s"
            )


def run(*command: object) -> None:
    """Run a command in the folder of temporary files."""
    subprocess.run([*map(str, command)], check=True, capture_output=True)


if __name__ == "__main__":
    main()
