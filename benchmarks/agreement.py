"""Compare the estimates of trials on emulated rigs with those on the simulated rig.

    python benchmarks/agreement.py             # three rigs, three conditions, 10 s each
    python benchmarks/agreement.py --rigs serial-board --seconds 4

The devices of each rig are emulated in another process and connected by pseudo-terminals. The
simulated operator, the cube and the seed are the same as on the simulated rig, which runs within
one process. A percentage is the relative difference between the mean estimate on the emulated rig
and the mean estimate on the simulated rig. A delay between force and position changes the damping
by k times the delay. On the soft cube, half a millisecond changes the damping by 1 N s/m.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from emulated import emulated

from sim_backend import DEPTH
from teleop.control.conditions import CONDITIONS

EXAMPLES = ("serial-board", "odrive-bota", "cia402-ft300")


def run(condition: str, seconds: float, *arguments: str | Path) -> dict[str, Any]:
    """Run a trial and return its summary."""
    command = [sys.executable, "-m", "teleop", "run", "--condition", condition, "--no-record",
               "--duration", str(seconds), "--json", *map(str, arguments)]  # fmt: skip
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    summary: dict[str, Any] = json.loads(done.stdout)
    return summary


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rigs", nargs="*", default=EXAMPLES)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    given = parser.parse_args()
    print(f"{given.seconds:g} s at {given.rate:g} Hz, k [N/m] and b [N s/m]")
    print(f"{'':24}" + "".join(f"{name:>26}" for name in ("rls", "ai", "me")) + "   pairs  missed")
    for condition in CONDITIONS:
        plain = run(condition, given.seconds)
        row(condition, "simulated", plain, plain)
        for name in given.rigs:
            with emulated(name, condition) as path:
                on_rig = ("--rig", path, "--rate", str(given.rate), "--specimen", "soft", "--yes")
                depth = f"{DEPTH[CONDITIONS[condition].moved_by]['soft']}m"
                wired = run(condition, given.seconds, *on_rig, "--depth", depth)
            row(condition, name, wired, plain)


def row(condition: str, name: str, wired: dict[str, Any], plain: dict[str, Any]) -> None:
    """Print one line of the table."""
    cells = ""
    for estimator, truth in plain["estimates"].items():
        found = wired["estimates"].get(estimator, {"k": float("nan"), "b": float("nan")})
        k, b = found["k"], found["b"]
        text = f"{k:6.0f} {b:6.1f}"
        if wired is not plain:
            text += f" {100 * (k / truth['k'] - 1):+5.1f}% {100 * (b / truth['b'] - 1):+5.0f}%"
        cells += f"{text:>26}"
    fault = wired["safety"]["fault"]
    end = f"  STOPPED: {fault['text']}" if fault else ""
    print(f"{condition:11}{name:13}{cells}{wired['pairs']:8}{wired['loop']['skipped']:8}{end}")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
