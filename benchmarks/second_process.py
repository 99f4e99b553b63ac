"""Measure the effect of a second process on a run in real time.

    python benchmarks/second_process.py              # 20 second processes of each kind
    python benchmarks/second_process.py --times 3 --kind run

While the slave of a first run moves, second processes are started one after another: none (this
shows the effect of the machine itself), another run, a run that fails because the first run uses
the port, a check and an emulator of another rig, `estimate`, and `reproduce`. A second process ends
by itself or is ended after some seconds. The first run should continue until then. The number of
second processes for which it did continue is printed. A first run that stopped is started again.
The longest time between two ticks, and the processor time that the host of the virtual machine took
(steal), are also printed. The exit code is 1 if a run with a second process did not continue.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from emulated import RIGS, emulated

KINDS = (
    "nothing",
    "run",
    "nothing, wired",
    "refused run",
    "rig check",
    "rig emulate",
    "estimate",
    "reproduce",
)
WIRED = ("nothing, wired", "refused run")
"""Kinds for which the first run uses an emulated rig.

Such a run stops if samples are older than 20 ms. This cannot happen with the simulated rig.
"""
STATED = ("--specimen", "soft", "--depth", "10mm", "--yes")
"""Options that a run on a hardware rig needs."""
DURATION = 3600.0
"""Duration of the first run [s]. The benchmark ends the run earlier."""
LONGEST = {"nothing": 3.0, "nothing, wired": 6.0, "rig emulate": 4.0, "reproduce": 5.0}
"""Time after which a second process is ended [s], by kind; 30 s for other kinds."""
AFTER = 0.3
"""Time after the second process for which the run must continue [s]."""
MOST = 100
"""Largest number of starts of a first run."""
MOVING = 20_000
"""Size of the recording from which on the slave moves [bytes]."""
STEAL = 8
"""Index of the steal time in the first line of /proc/stat."""


def steal() -> float:
    """Return the processor time that the host has taken since the start of the machine [s]."""
    fields = Path("/proc/stat").read_text().splitlines()[0].split()
    return int(fields[STEAL]) / os.sysconf("SC_CLK_TCK")


def start(teleop: list[str], *arguments: Any) -> subprocess.Popen[str]:
    """Start a teleop process whose standard output can be read."""
    command = [*teleop, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def second_arguments(kind: str, folder: Path, rig: Path | None, other: Path) -> list[Any]:
    """Return the arguments of the second process; empty if there is none."""
    return {
        "nothing": [],
        "nothing, wired": [],
        "run": ["run", "--no-record", "--duration", "1"],
        "refused run": ["run", "--no-record", "--rig", rig, *STATED],
        "rig check": ["rig", "check", other, "--seconds", "1", "--duration", "1"],
        "rig emulate": ["rig", "emulate", RIGS / "odrive-bota.toml", "--out", folder / "e.toml"],
        "estimate": ["estimate", folder.parents[1] / "data.mcap", "--estimators", "all"],
        "reproduce": ["reproduce", "--out", folder / "reproduction"],
    }[kind]


class First:
    """The first run, which is started again if it stops."""

    def __init__(self, teleop: list[str], folder: Path, rig: Path | None) -> None:
        self._teleop, self._folder, self._rig = teleop, folder, rig
        self._process: subprocess.Popen[str] | None = None
        self._count = 0
        self.gaps: list[float] = []
        """Longest time between two ticks of each run [s]."""
        self.faults: list[str] = []
        """Faults of the runs that stopped by themselves."""

    def ensure(self) -> None:
        """Start the run unless it is running, and wait until it moves."""
        while not self._process:
            self._count += 1
            if self._count > MOST:
                raise SystemExit(f"the first run does not start: {self.faults[-1]}")
            path = self._folder / f"run-{self._count}.mcap"
            on = ("--rig", self._rig, "--condition", "autonomous", *STATED) if self._rig else ()
            arguments = ("--json", "--duration", DURATION, "--record", path, *on)
            self._process = start(self._teleop, "run", *arguments)
            while not (path.exists() and path.stat().st_size > MOVING):
                if not self.is_running():
                    break
                time.sleep(0.02)

    def is_running(self) -> bool:
        """Return whether the run continues; if not, store its fault."""
        if self._process and self._process.poll() is None:
            return True
        self.end()
        return False

    def end(self) -> None:
        """End the run, and store its longest gap and its fault."""
        if not self._process:
            return
        stopped = self._process.poll() is not None
        self._process.terminate()
        out, _ = self._process.communicate()
        code, self._process = self._process.returncode, None
        summary = json.loads(out) if out else None
        if summary:
            self.gaps.append(summary["loop"]["longest_gap_s"])
        if stopped:
            fault = summary and summary["safety"]["fault"]
            self.faults.append(f"exit {code}: {fault['text'] if fault else 'no fault'}")


def run_second(first: First, teleop: list[str], arguments: list[Any], longest: float) -> int | None:
    """Run a second process and return its exit code; None if there is none."""
    first.ensure()
    time.sleep(random.uniform(0.0, 0.3))
    if not arguments:
        time.sleep(longest)
        return None
    second = start(teleop, *arguments)
    with contextlib.suppress(subprocess.TimeoutExpired):
        second.wait(longest)
    second.terminate()
    second.communicate()
    time.sleep(AFTER)
    return second.returncode


@contextlib.contextmanager
def rigs(kind: str) -> Iterator[tuple[Path | None, Path]]:
    """Yield the rig files of the first run (None for the simulated rig) and the second process."""
    with contextlib.ExitStack() as stack:
        rig = stack.enter_context(emulated("serial-board")) if kind in WIRED else None
        other = stack.enter_context(emulated("serial-board")) if kind == "rig check" else Path()
        yield rig, other


def measure(kind: str, teleop: list[str], folder: Path, times: int) -> int:
    """Print a line for a kind of second process; return how often the run did not continue."""
    folder.mkdir()
    stolen, continued, codes = steal(), 0, set()
    with rigs(kind) as (rig, other):
        first = First(teleop, folder, rig)
        for i in range(times):
            (folder / f"{i}").mkdir()
            arguments = second_arguments(kind, folder / f"{i}", rig, other)
            codes.add(run_second(first, teleop, arguments, LONGEST.get(kind, 30.0)))
            continued += first.is_running()
        first.end()
    exits = ", ".join(str(code) for code in sorted(codes - {None}, key=str)) or "none"
    print(
        f"{kind:<14} {continued:2d} of {times} went on; longest time between two ticks "
        f"{max(first.gaps) * 1e3:6.1f} ms; steal {steal() - stolen:.2f} s; "
        f"exit codes of the second process: {exits}",
        *(f"    {fault}" for fault in first.faults),
        sep="\n",
        flush=True,
    )
    return times - continued if not kind.startswith("nothing") else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--kind", choices=KINDS, nargs="*", default=KINDS)
    parser.add_argument(
        "--python", default=sys.executable, help="Python interpreter with the teleop to test"
    )
    options = parser.parse_args()
    teleop = [options.python, "-P", "-m", "teleop"]
    stopped = 0
    with tempfile.TemporaryDirectory() as name:
        data = Path(name) / "data.mcap"
        made = start(teleop, "run", "--clock", "virtual", "--duration", "20", "--record", data)
        made.communicate()
        for kind in options.kind:
            stopped += measure(kind, teleop, Path(name) / kind, options.times)
    return 1 if stopped else 0


if __name__ == "__main__":
    sys.exit(main())
