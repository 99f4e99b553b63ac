"""Measure time and memory for long recordings: `python benchmarks/long_recordings.py`.

A trial is run in virtual time. Its recording is repeated up to each length, from seconds to hours.
Each command evaluates the long recording in its own process. This process reports its processor
time and its largest memory. The option `--against` states the folder with the source of another
version, which is measured in the same run.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from teleop.recording.mcap_reader import read_intact
from teleop.recording.mcap_writer import END, McapFile
from teleop.recording.stream import FIELD, tick_values

COMMANDS = {
    "estimate, 3 estimators": ("estimate", "{file}", "--estimators=rls,ai,me", "--json"),
    "estimate, all": ("estimate", "{file}", "--estimators=all", "--json"),
    "report": ("report", "{file}", "--out={folder}/page.html", "--overwrite"),
    "compare": ("compare", "{file}", "--json"),
    "export CSV": ("export", "{file}", "--out={folder}/table.csv", "--overwrite"),
    "export HDF5": ("export", "{file}", "--out={folder}/table.h5", "--overwrite"),
    "export Parquet": ("export", "{file}", "--out={folder}/table.parquet", "--overwrite"),
}
MEASURED = """
import contextlib, io, resource, sys, time
from teleop.cli import main
begin = time.perf_counter()
with contextlib.redirect_stdout(io.StringIO()):
    code = main(sys.argv[1:])
seconds = time.perf_counter() - begin
usage = resource.getrusage(resource.RUSAGE_SELF)
print(code, seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0)
"""
FLUSHED = 500
"""Number of ticks in a chunk of the recording."""


def repeat(source: Path, out: Path, seconds: float) -> None:
    """Write a recording of a length [s], which repeats the ticks of the recording `source`."""
    contents = read_intact(source)
    rows = np.frombuffer(contents.messages, np.uint8).reshape(-1, contents.size)
    t = tick_values(rows)[0]
    metadata = {name: text for name, text in contents.metadata.items() if name != END}
    columns = [(name, unit, "") for name, unit, _ in FIELD.findall(contents.definition)]
    file = McapFile(out, columns, contents.definition, metadata)
    file.begin(contents.start)
    period = float(t[-1] - t[0] + np.median(np.diff(t)))
    for turn in range(int(np.ceil(seconds / period)) + 1):
        times = t + turn * period
        part = rows.copy()
        part[:, 4:12] = times.astype("<f8")[:, None].view(np.uint8)
        for i in range(int(np.searchsorted(times, seconds))):
            file.tick(part[i].tobytes(), float(times[i]))
            if i % FLUSHED == 0:
                file.flush()
    file.flush()
    file.end(0)
    file.close()


def measure(arguments: list[str], tree: Path | None) -> str:
    """Run a command, and return its time [s], processor time [s] and memory [MB] as text."""
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1")
    if tree:
        environment["PYTHONPATH"] = str(tree)
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, *arguments],
        env=environment,
        capture_output=True,
        text=True,
        cwd=tree,
    )
    if done.returncode:
        return f"{done.stderr.strip().splitlines()[-1]:.40}"
    code, seconds, processor, memory = map(float, done.stdout.split())
    problem = "" if code == 0 else f" exit code {code:.0f}"
    return f"{seconds:7.1f} s {processor:7.1f} s {memory:6.0f} MB{problem}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", default="10,600,3600")
    parser.add_argument("--commands", default="|".join(COMMANDS), help="separated by |")
    parser.add_argument("--against", type=Path)
    options = parser.parse_args()
    trees = {"this version": None} | ({"other": options.against} if options.against else {})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = folder / "trial.mcap"
        trial = ["--condition=autonomous", "--clock=virtual", "--duration=60", f"--record={source}"]
        subprocess.run(
            [sys.executable, "-m", "teleop", "run", *trial], check=True, stdout=subprocess.DEVNULL
        )
        print("time, processor time and largest memory of each command")
        for seconds in map(float, options.seconds.split(",")):
            file = folder / f"{seconds:g}.mcap"
            repeat(source, file, seconds)
            size = file.stat().st_size / 1e6
            print(f"{seconds:g} s at 1 kHz, {size:.0f} MB, load {os.getloadavg()[0]:.0f}")
            for command in options.commands.split("|"):
                arguments = [one.format(file=file, folder=folder) for one in COMMANDS[command]]
                for title, tree in trees.items():
                    print(f"  {command:24} {title:13} {measure(arguments, tree)}", flush=True)
            file.unlink()


if __name__ == "__main__":
    main()
