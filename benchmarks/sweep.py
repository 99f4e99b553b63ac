"""Measure the time of sweeps: `python benchmarks/sweep.py [--trials 1000] [--settings 10000]`.

Trials of 10 s are run by one process, by two processes, and on a local Dask cluster with two
workers. One process runs fewer trials than two processes. Then the paper's three estimators are
computed on one recording of 10 s with many settings. The processor time of all processes is also
measured, because the time on a shared machine depends on the load.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

SETTINGS = """
name = "settings"
design = "latin-hypercube"
points = {count}
[estimate]
recording = "trial.mcap"
[factors]
"estimator_parameters.rls.forgetting" = {{ low = 0.9, high = 0.999 }}
bandwidth_hz = [20.0, 50.0, 100.0]
"""


class Cost(NamedTuple):
    """Time of a command."""

    time: float
    """Time from the start to the end of the command [s]."""
    processor: float
    """Processor time of all processes of the command [s]."""

    def line(self, title: str, count: int, one: float | None = None) -> str:
        """Return a line of the table for a command that computed `count` points.

        `one` is the time of a point in one process [s], from which the parallel efficiency of two
        processes is computed.
        """
        each = self.processor / count
        efficiency = f"{one * count / self.time / 2.0:12.2f}" if one else ""
        return (
            f"{title:24}{count:7}{self.time:9.1f} s{self.processor:9.1f} s{each * 1e3:9.1f} ms"
            f"{efficiency}"
        )


def teleop(folder: Path, *arguments: str) -> Cost:
    """Run a command in a folder, and return its cost."""
    begin, spent = time.perf_counter(), processor_time()
    command = [sys.executable, "-m", "teleop", *arguments]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return Cost(time.perf_counter() - begin, processor_time() - spent)


def processor_time() -> float:
    """Return the processor time of all processes that have ended [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--settings", type=int, default=10_000)
    options = parser.parse_args()
    seeds = max(1, options.trials // 9)
    few = max(1, seeds // 8)
    sweep = ("sweep", "paper", f"--seeds={seeds}", "--workers=2")
    print(f"{'trials of 10 s':24}{'points':>7}{'time':>11}{'processor':>11}{'a point':>12}", end="")
    print(f"{'efficiency':>12}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        one = teleop(folder, "sweep", "paper", f"--seeds={few}", "--workers=1", "--out=one")
        print(one.line("one process", 9 * few), flush=True)
        each = one.time / (9 * few)
        two = teleop(folder, *sweep, "--out=two")
        print(two.line("two processes", 9 * seeds, each), flush=True)
        dask = teleop(folder, *sweep, "--dask=local", "--out=dask")
        print(dask.line("Dask, two workers", 9 * seeds, each), flush=True)
        teleop(folder, "run", "--clock=virtual", "--record=trial.mcap")
        (folder / "few.toml").write_text(SETTINGS.format(count=200))
        teleop(folder, "sweep", "few.toml", "--out=few")
        (folder / "settings.toml").write_text(SETTINGS.format(count=options.settings))
        settings = teleop(folder, "sweep", "settings.toml", "--workers=2", "--out=settings")
        print("settings of three estimators on a recording of 10 s")
        print(settings.line("two processes", options.settings), flush=True)
    print(f"load average of the machine with {os.cpu_count()} cores: {os.getloadavg()[1]:.1f}")


if __name__ == "__main__":
    main()
