"""Measure the time of `teleop compare` with many files: `python benchmarks/batch.py [--files 200]`.

The files are CSV files of 6 s at 500 Hz, with subject, specimen and repetition in their names. The
command writes a table, two figures, an analysis of variance and the repeatability. It is then
killed when half of the files are evaluated, and entered again. The time is compared with that of
`teleop estimate` for each file.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SUBJECTS = 5
STIFFNESS = {"fat": 600.0, "liver": 1500.0, "muscle": 2400.0, "skin": 4000.0}
SEED = 20460017
ESTIMATED = 10
"""Number of files that `teleop estimate` evaluates."""
STORE = ".teleop-compare"


def write_files(folder: Path, count: int) -> list[Path]:
    """Write recordings of sines on Kelvin-Voigt bodies, and return their paths."""
    rng = np.random.default_rng(SEED)
    t = np.arange(0.0, 6.0, 2e-3)
    phase = 2.0 * np.pi * t
    paths = []
    for subject in range(1, SUBJECTS + 1):
        (folder / f"s{subject:02}").mkdir(parents=True)
        of_subject = rng.normal(0.0, 60.0)
        for specimen, stiffness in STIFFNESS.items():
            of_specimen = rng.normal(0.0, 20.0)
            for n in range(1, count // (SUBJECTS * len(STIFFNESS)) + 1):
                k = stiffness + of_subject + of_specimen + rng.normal(0.0, 30.0)
                x, v = 3e-3 * (1.0 - np.cos(phase)), 6e-3 * np.pi * np.sin(phase)
                f = k * x + 8.0 * v + rng.normal(0.0, 0.02, t.size)
                x += rng.normal(0.0, 1e-6, t.size)
                path = folder / f"s{subject:02}" / f"{specimen}_rep{n}.csv"
                table = np.column_stack([t, 1e3 * x, f])
                heading = "Time [s],Position [mm],Force [N]"
                np.savetxt(path, table, "%.6f", ",", header=heading, comments="")
                paths.append(path)
    return paths


def teleop(*arguments: object) -> list[str]:
    """Return a command of teleop."""
    return [sys.executable, "-m", "teleop", *map(str, arguments)]


def seconds(command: list[str]) -> float:
    """Run a command, and return the time that it takes [s]."""
    begin = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--files", type=int, default=200)
    count = parser.parse_args().files
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = write_files(folder / "data", count)
        each = seconds(teleop("estimate", paths[0]))  # the first also compiles the modules
        each = sum(seconds(teleop("estimate", path)) for path in paths[:ESTIMATED]) / ESTIMATED

        def compare(out: Path) -> list[str]:
            out.mkdir(exist_ok=True)
            options = ["--factors", "{subject}/{specimen}_rep{n}.csv", "--by", "specimen"]
            options += ["--anova", "k", "--repeatability", "k", "--over", "n=1,2"]
            options += ["--plot", out / "figure.pdf", "--plot-agreement", out / "agreement.pdf"]
            return teleop("compare", folder / "data", *options, "--out", out / "table.csv")

        whole, killed = folder / "whole", folder / "killed"
        at_once = seconds(compare(whole))
        with subprocess.Popen(compare(killed), stdout=subprocess.DEVNULL) as process:
            while process.poll() is None and len([*(killed / STORE).glob("*.json")]) < count / 2:
                time.sleep(0.01)
            process.kill()
        stored = len([*(killed / STORE).glob("*.json")])
        for table in killed.glob("table*.csv"):  # if the command had ended already
            table.unlink()
        resumed = seconds(compare(killed))
        again = seconds([*compare(killed), "--overwrite"])
        tables = [table.name for table in whole.glob("*.csv")]
        same = all((whole / one).read_bytes() == (killed / one).read_bytes() for one in tables)
    print(f"{len(paths)} files of 6 s at 500 Hz, {os.cpu_count()} processors")
    print(f"teleop estimate, a file:      {each:6.2f} s, all files one by one {each * count:.0f} s")
    print(
        f"teleop compare, all files:    {at_once:6.1f} s, {each * count / at_once:.0f} times faster"
    )
    print(f"killed with {stored:3} results, then: {resumed:6.1f} s")
    print(f"with all results stored:      {again:6.1f} s")
    print(
        f"the {len(tables)} tables after the kill are {'' if same else 'not '}the same to the bit"
    )
    print(f"load average of the machine: {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
