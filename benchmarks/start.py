"""Time from the start of a command to its first result: `python benchmarks/start.py`.

For `teleop run`, the result is the first tick of a trial in real time on the simulated rig. For the
other commands, it is the end of the command. Each command is started several times, in turn with a
Python process that only imports numpy.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import date
from pathlib import Path
from statistics import median

from teleop.recording.mcap_reader import read_intact


def first_tick(folder: Path) -> float:
    """Return the time from the start of `teleop run` to its first tick [s]."""
    file = folder / "trial.mcap"
    begin = time.time()
    run(folder, "-m", "teleop", "run", "--duration=0.2", f"--record={file}")
    start = read_intact(file).start * 1e-9 - begin
    file.unlink()
    return start


def reproduce(folder: Path) -> float:
    """Return the duration of `teleop reproduce` [s]."""
    return run(folder, "-m", "teleop", "reproduce", "--out=paper", "--overwrite")


def no_arguments(folder: Path) -> float:
    """Return the duration of `teleop` without arguments [s]."""
    return run(folder, "-m", "teleop")


def numpy_only(folder: Path) -> float:
    """Return the duration of a Python process that imports numpy [s]."""
    return run(folder, "-c", "import numpy")


CASES: dict[str, Callable[[Path], float]] = {
    "import numpy, in an empty Python": numpy_only,
    "teleop": no_arguments,
    "teleop run, to its first tick": first_tick,
    "teleop reproduce": reproduce,
}


def run(folder: Path, *arguments: str) -> float:
    """Run Python in a folder, and return the duration [s]."""
    begin = time.perf_counter()
    command = [sys.executable, *arguments]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--times", type=int, default=5)
    options = parser.parse_args()
    print(f"# python benchmarks/start.py --times {options.times}, {date.today()}")
    print(f"median and greatest time [s], load {os.getloadavg()[0]:.1f}")
    found: dict[str, list[float]] = {name: [] for name in CASES}
    with tempfile.TemporaryDirectory() as name:
        for _ in range(options.times + 1):
            for title, case in CASES.items():
                found[title].append(case(Path(name)))
    for title, (_, *times) in found.items():
        print(f"{title:36}{median(times):8.2f}{max(times):8.2f}")


if __name__ == "__main__":
    main()
