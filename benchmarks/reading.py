"""Measure time and memory to read a large CSV file: `python benchmarks/reading.py`.

The readers are teleop, and pandas and pyarrow if they are installed. Each reader reads the same
columns of the same file in its own process. Only teleop checks every cell, and states the line of
an invalid cell.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

READERS = {
    "teleop": "from teleop.evaluation.reading.signals import read_signals\n"
    "n = len(read_signals(Path(path)).t)",
    "teleop, text in a column": "from teleop.evaluation.reading.signals import read_signals\n"
    "n = len(read_signals(Path(path.replace('.csv', '-notes.csv'))).t)",
    "pandas": "import pandas\nn = len(pandas.read_csv(path))",
    "pandas, pyarrow engine": "import pandas\nn = len(pandas.read_csv(path, engine='pyarrow'))",
    "pyarrow": "from pyarrow import csv\nn = len(csv.read_csv(path))",
}


def write_files(path: Path, megabytes: float) -> None:
    """Write a palpation at 1 kHz to a file of this size, and with a text column to another file."""
    rng = np.random.default_rng(0)
    rows = 20_000
    with_notes = path.with_name(path.name.replace(".csv", "-notes.csv"))
    with path.open("w") as file, with_notes.open("w") as notes:
        file.write("Time [s],Position [mm],Force [N]\n")
        notes.write("Time [s],Position [mm],Force [N],Note\n")
        start = 0
        while file.tell() < megabytes * 1e6:
            t = (start + np.arange(rows)) * 1e-3
            x = 5.0 - 4.0 * np.cos(2.0 * np.pi * t)
            f = 2.0 * x + rng.normal(0.0, 0.02, rows)
            lines = [f"{a:.3f},{b:.6f},{c:.12f}" for a, b, c in zip(t, x, f, strict=True)]
            file.write("\n".join(lines) + "\n")
            notes.write(",loading\n".join(lines) + ',"held, still"\n')
            start += rows


def measure(reader: str, path: Path) -> None:
    """Print time [s], processor time [s], peak memory [MB] and number of samples of one reader."""
    begin, busy = time.perf_counter(), time.process_time()
    names = {"path": str(path), "Path": Path}
    exec(READERS[reader], names)
    taken, busy = time.perf_counter() - begin, time.process_time() - busy
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(taken, busy, peak, names["n"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=float, default=500.0)
    parser.add_argument("--read", choices=READERS)
    parser.add_argument("--file", type=Path)
    options = parser.parse_args()
    if options.read:
        measure(options.read, options.file)
        return
    table = Table(title=f"{options.megabytes:g} MB of CSV, three columns")
    for heading in ("", "time [s]", "processor [s]", "MB/s", "peak memory [MB]", "samples"):
        table.add_column(heading, justify="right" if heading else "left")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.csv"
        write_files(path, options.megabytes)
        for reader in READERS:
            command = [sys.executable, __file__, "--read", reader, "--file", str(path)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                table.add_row(reader, done.stderr.strip().rpartition("\n")[2])
                continue
            taken, busy, peak, samples = map(float, done.stdout.split())
            speed = options.megabytes / taken
            cells = (f"{taken:.1f}", f"{busy:.1f}", f"{speed:.0f}", f"{peak:.0f}", f"{samples:.0f}")
            table.add_row(reader, *cells)
    Console().print(table)


if __name__ == "__main__":
    main()
