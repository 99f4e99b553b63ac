"""Runs in real time beside a second process of each kind: how many go on.

    python benchmarks/second_process.py              # 20 runs beside each kind
    python benchmarks/second_process.py --times 3 --kind run

A run is started and, once it moves, a second process: nothing (the baseline: what the machine does
by itself), another run, a run that is refused since the first run has the port, a check and an
emulator of another rig, `estimate`, and `reproduce`. Once it has ended, or after a few seconds, the
run is ended by SIGINT. Counted are the runs that went on until then, without a fault. Beside it
stand the longest time between two ticks of a run, and how much time the machine's host took from it
meanwhile (steal). Exits with 1 if a run beside a second process did not go on.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from emulated import RIGS, emulated

KINDS = (
    "nothing",
    "run",
    "refused run",
    "rig check",
    "rig emulate",
    "estimate",
    "reproduce",
)
DURATION = 60.0
"""Of the first run, unless it is ended [s]."""
LONGEST = {"nothing": 4.0, "rig emulate": 4.0, "reproduce": 4.0}
"""Time after which a second process is ended [s]; 15 for those that are not named."""
MOVING = 20_000
"""Bytes of a recording by which a run moves."""
WENT_ON = 130
"""Exit code of a run that was ended by SIGINT."""
STEAL = 8
"""Place of the host's share in the first line of /proc/stat."""


class Result(NamedTuple):
    """One run beside a second process."""

    code: int
    """Exit code of the run; 130 if it went on."""
    fault: str
    longest_gap: float
    """Longest time between two ticks [s]."""
    steal: float
    """Time that the host took meanwhile, over all processors [s]."""
    second: int
    """Exit code of the second process; 0 where there is none."""


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
        "run": ["run", "--no-record", "--duration", "1"],
        "refused run": ["run", "--no-record", "--rig", rig],
        "rig check": ["rig", "check", other, "--seconds", "1"],
        "rig emulate": ["rig", "emulate", RIGS / "odrive-bota.toml", "--out", folder / "e.toml"],
        "estimate": ["estimate", folder.parent / "data.mcap", "--estimators", "all"],
        "reproduce": ["reproduce", "--out", folder / "reproduction"],
    }[kind]


def beside(kind: str, teleop: list[str], folder: Path, rig: Path | None, other: Path) -> Result:
    """Run once, with a second process beside it."""
    folder.mkdir()
    path = folder / "run.mcap"
    on = ("--rig", rig, "--condition", "autonomous") if rig else ()
    taken = steal()
    first = start(teleop, "run", "--json", "--duration", DURATION, "--record", path, *on)
    while first.poll() is None and not (path.exists() and path.stat().st_size > MOVING):
        time.sleep(0.02)
    time.sleep(random.uniform(0.0, 0.3))
    arguments = second_arguments(kind, folder, rig, other)
    second = start(teleop, *arguments) if arguments else None
    code = 0
    if second:
        with contextlib.suppress(subprocess.TimeoutExpired):
            second.wait(LONGEST.get(kind, 15.0))
        second.terminate()
        second.communicate()
        code = second.returncode
    else:
        time.sleep(LONGEST[kind])
    first.send_signal(signal.SIGINT)
    out, _ = first.communicate()
    taken = steal() - taken
    summary = (
        json.loads(out) if out else {"safety": {"fault": None}, "loop": {"longest_gap_s": 0.0}}
    )
    fault = summary["safety"]["fault"]
    return Result(
        first.returncode,
        fault["text"] if fault else "",
        summary["loop"]["longest_gap_s"],
        taken,
        code,
    )


@contextlib.contextmanager
def rigs(kind: str) -> Iterator[tuple[Path | None, Path]]:
    """The rig of the first run, if it has one, and that of the second process."""
    with contextlib.ExitStack() as stack:
        rig = stack.enter_context(emulated("serial-board")) if kind == "refused run" else None
        other = stack.enter_context(emulated("serial-board")) if kind == "rig check" else Path()
        yield rig, other


def report(kind: str, results: list[Result]) -> int:
    """Print a line; how many runs did not go on."""
    gone_on = sum(r.code == WENT_ON for r in results)
    gaps = sorted(r.longest_gap for r in results)
    codes = sorted({r.second for r in results})
    print(
        f"{kind:<14} {gone_on:2d} of {len(results)} runs went on; longest time between ticks "
        f"[ms]: median {gaps[len(gaps) // 2] * 1e3:6.1f}, max {gaps[-1] * 1e3:6.1f}; "
        f"steal {sum(r.steal for r in results):.2f} s; second process: exit {codes}",
        flush=True,
    )
    for result in results:
        if result.code != WENT_ON:
            print(f"    exit {result.code}, steal {result.steal:.2f} s: {result.fault}", flush=True)
    return len(results) - gone_on if kind != "nothing" else 0


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
            with rigs(kind) as (rig, other):
                results = [
                    beside(kind, teleop, Path(name) / f"{kind}-{i}", rig, other)
                    for i in range(options.times)
                ]
            stopped += report(kind, results)
    return 1 if stopped else 0


if __name__ == "__main__":
    sys.exit(main())
