"""Time of sweeps: `python benchmarks/sweep.py [--trials 1000] [--settings 10000]`.

Trials of 10 s are run by one and by two processes and on a local Dask cluster with two workers.
Then the paper's three estimators are computed on one recording of 10 s with many settings. The
trials by one process are fewer; their time is scaled to the number of trials.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

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


def teleop(folder: Path, *arguments: str) -> float:
    """Run a command in a folder, and return its time [s]."""
    begin = time.perf_counter()
    command = [sys.executable, "-m", "teleop", *arguments]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--settings", type=int, default=10_000)
    options = parser.parse_args()
    seeds = max(1, options.trials // 9)
    few = max(1, seeds // 8)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        one = teleop(folder, "sweep", "paper", f"--seeds={few}", "--workers=1", "--out=one")
        one *= seeds / few
        two = teleop(folder, "sweep", "paper", f"--seeds={seeds}", "--workers=2", "--out=two")
        dask = teleop(
            folder, "sweep", "paper", f"--seeds={seeds}", "--workers=2", "--dask=local", "--out=d"
        )
        teleop(folder, "run", "--clock=virtual", "--record=trial.mcap")
        (folder / "few.toml").write_text(SETTINGS.format(count=200))
        teleop(folder, "sweep", "few.toml", "--out=few")
        (folder / "settings.toml").write_text(SETTINGS.format(count=options.settings))
        settings = teleop(folder, "sweep", "settings.toml", "--workers=2", "--out=settings")
    load = os.getloadavg()[1]
    print(f"{9 * seeds} trials of 10 s (load average {load:.1f})")
    print(f"  one process    {one:7.1f} s, scaled from {9 * few} trials")
    print(f"  two processes  {two:7.1f} s, parallel efficiency {one / two / 2.0:.2f}")
    print(f"  Dask, two workers {dask:4.1f} s, {dask / two:.2f} of two processes")
    print(f"{options.settings} settings of three estimators on a recording of 10 s")
    print(f"  two processes  {settings:7.1f} s")


if __name__ == "__main__":
    main()
