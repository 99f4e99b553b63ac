"""Runs in real time beside a second process of each kind: how many go on.

    python benchmarks/second_process.py              # 20 runs beside each kind
    python benchmarks/second_process.py --times 3 --kind run

Beside a run that moves, second processes are started one after the other: none (the baseline: what
the machine does by itself), another run, a run that is refused since the first has the port, a
check and an emulator of another rig, `estimate`, and `reproduce`. Counted is how often the run went
on until the second process had ended, or was ended after some seconds; a run that stopped is
started anew. Beside it stand the longest time between two ticks, and how much time the machine's
host took meanwhile (steal). Exits with 1 if a run beside a second process did not go on.
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
"""Kinds for which the first run is on an emulated rig; it stops where a simulated rig goes on, if
samples are older than 20 ms."""
DURATION = 3600.0
"""Of the first run, which is ended before [s]."""
LONGEST = {"nothing": 3.0, "nothing, wired": 6.0, "rig emulate": 4.0, "reproduce": 5.0}
"""Time after which a second process is ended [s]; 30 for those that are not named."""
AFTER = 0.3
"""Time after the second process for which the run must go on too [s]."""
MOST = 100
"""Times that a first run is started."""
MOVING = 20_000
"""Bytes of a recording by which a run moves."""
STEAL = 8
"""Place of the host's share in the first line of /proc/stat."""


def steal() -> float:
    """Time that the host has taken since the start of the machine [s]."""
    fields = Path("/proc/stat").read_text().splitlines()[0].split()
    return int(fields[STEAL]) / os.sysconf("SC_CLK_TCK")


def start(teleop: list[str], *arguments: Any) -> subprocess.Popen[str]:
    """A teleop process whose output is kept."""
    command = [*teleop, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def second_arguments(kind: str, folder: Path, rig: Path | None, other: Path) -> list[Any]:
    """The arguments of the second process; empty for none."""
    return {
        "nothing": [],
        "nothing, wired": [],
        "run": ["run", "--no-record", "--duration", "1"],
        "refused run": ["run", "--no-record", "--rig", rig],
        "rig check": ["rig", "check", other, "--seconds", "1"],
        "rig emulate": ["rig", "emulate", RIGS / "odrive-bota.toml", "--out", folder / "e.toml"],
        "estimate": ["estimate", folder.parents[1] / "data.mcap", "--estimators", "all"],
        "reproduce": ["reproduce", "--out", folder / "reproduction"],
    }[kind]


class First:
    """The run beside which others are started, again and again if it stops."""

    def __init__(self, teleop: list[str], folder: Path, rig: Path | None) -> None:
        self._teleop, self._folder, self._rig = teleop, folder, rig
        self._process: subprocess.Popen[str] | None = None
        self._count = 0
        self.gaps: list[float] = []
        """Longest time between two ticks of each run [s]."""
        self.faults: list[str] = []
        """Why runs stopped, but for the last of all."""

    def ensure(self) -> None:
        """Start it unless it goes on, and wait until it moves."""
        while not self._process:
            self._count += 1
            if self._count > MOST:
                raise SystemExit(f"the first run does not start: {self.faults[-1]}")
            path = self._folder / f"run-{self._count}.mcap"
            on = ("--rig", self._rig, "--condition", "autonomous") if self._rig else ()
            arguments = ("--json", "--duration", DURATION, "--record", path, *on)
            self._process = start(self._teleop, "run", *arguments)
            while not (path.exists() and path.stat().st_size > MOVING):
                if not self.goes_on():
                    break
                time.sleep(0.02)

    def goes_on(self) -> bool:
        """Whether it does; else its fault is kept."""
        if self._process and self._process.poll() is None:
            return True
        self.end()
        return False

    def end(self) -> None:
        """End it, and keep what it says."""
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


def beside(first: First, teleop: list[str], arguments: list[Any], longest: float) -> int | None:
    """Start a second process; its exit code."""
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
    """The rig of the first run, if it has one, and that of the second process."""
    with contextlib.ExitStack() as stack:
        rig = stack.enter_context(emulated("serial-board")) if kind in WIRED else None
        other = stack.enter_context(emulated("serial-board")) if kind == "rig check" else Path()
        yield rig, other


def measure(kind: str, teleop: list[str], folder: Path, times: int) -> int:
    """Print a line about a kind of second process; how many runs did not go on."""
    folder.mkdir()
    taken, gone_on, codes = steal(), 0, set()
    with rigs(kind) as (rig, other):
        first = First(teleop, folder, rig)
        for i in range(times):
            (folder / f"{i}").mkdir()
            arguments = second_arguments(kind, folder / f"{i}", rig, other)
            codes.add(beside(first, teleop, arguments, LONGEST.get(kind, 30.0)))
            gone_on += first.goes_on()
        first.end()
    exits = ", ".join(str(code) for code in sorted(codes - {None}, key=str)) or "none"
    print(
        f"{kind:<14} {gone_on:2d} of {times} went on; longest time between two ticks "
        f"{max(first.gaps) * 1e3:6.1f} ms; steal {steal() - taken:.2f} s; "
        f"exit codes of the second process: {exits}",
        *(f"    {fault}" for fault in first.faults),
        sep="\n",
        flush=True,
    )
    return times - gone_on if not kind.startswith("nothing") else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--kind", choices=KINDS, nargs="*", default=KINDS)
    parser.add_argument("--python", default=sys.executable, help="runs the teleop to be tested")
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
