"""Measure time and memory for long recordings: `python benchmarks/long_recordings.py`.

A trial is run in virtual time. Its recording is repeated up to each length, from seconds to hours.
With the option `--run`, a trial of each length is run instead, and measured too. Each command
evaluates the long recording in its own process. This process reports its processor time, its
largest memory, and the largest memory of its child processes (the recorder). The option `--against`
states the folder with the source of another version, which is measured in the same run. With
`--recording`, the commands evaluate an existing recording.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from datetime import date
from pathlib import Path

import numpy as np

from teleop.recording.mcap_reader import read_intact
from teleop.recording.mcap_writer import END, McapFile
from teleop.streams.message import FIELD, tick_values

TRIAL = ("run", "--condition=autonomous", "--clock=virtual", "--json")
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
children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(code, seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, children / 1024)
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
    """Run a command, and return its times [s] and the memory of its processes [MB] as text."""
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
    code, seconds, processor, memory, recorder = map(float, done.stdout.split())
    text = f"{seconds:7.1f} s {processor:7.1f} s {memory:6.0f} MB"
    text += f", child {recorder:.0f} MB" if recorder else ""
    return text + (f" exit code {code:.0f}" if code else "")


def measure_commands(
    file: Path, folder: Path, commands: list[str], trees: dict[str, Path | None]
) -> None:
    """Print time and memory of each command with each version."""
    print(f"  the recording has {file.stat().st_size / 1e6:.0f} MB", flush=True)
    for command in commands:
        arguments = [one.format(file=file, folder=folder) for one in COMMANDS[command]]
        for title, tree in trees.items():
            print(f"  {command:24} {title:13} {measure(arguments, tree)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", default="10,600,3600")
    parser.add_argument("--commands", default="|".join(COMMANDS), help="separated by |")
    parser.add_argument("--run", action="store_true", help="run a trial of each length")
    parser.add_argument("--recording", type=Path, help="an existing recording")
    parser.add_argument("--against", type=Path)
    options = parser.parse_args()
    trees = {"this version": None} | ({"other": options.against} if options.against else {})
    commands = options.commands.split("|")
    print(f"# python benchmarks/long_recordings.py {' '.join(sys.argv[1:])}, {date.today()}")
    print("time, processor time and largest memory of each command")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.recording:
            measure_commands(options.recording, folder, commands, trees)
            return
        source = folder / "trial.mcap"
        if not options.run:
            measure([*TRIAL, "--duration=60", f"--record={source}"], None)
        for seconds in map(float, options.seconds.split(",")):
            file = folder / f"{seconds:g}.mcap"
            print(f"{seconds:g} s at 1 kHz, load {os.getloadavg()[0]:.0f}", flush=True)
            if options.run:
                trial = [*TRIAL, f"--duration={seconds}", f"--record={file}"]
                print(f"  {'run':24} {'this version':13} {measure(trial, None)}", flush=True)
            else:
                repeat(source, file, seconds)
            measure_commands(file, folder, commands, trees)
            file.unlink()


if __name__ == "__main__":
    main()
