"""Compare `teleop machine check` with trials of the same rate, one after the other.

    python benchmarks/machine_check.py

In each round, the loop is measured by `teleop machine check`, and then in a trial with its
recorder, as in `loop.py`. The rounds are at 1 kHz, at 4 kHz, and at both rates beside a busy
program on each processor.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
from datetime import date
from pathlib import Path
from typing import Any

from loop import busy, run

RATES = (1000, 4000)


def check(rate: int, seconds: float) -> dict[str, Any]:
    """Run `teleop machine check`, and return its document."""
    options = ["--rate", str(rate), "--duration", str(seconds), "--json"]
    done = subprocess.run(
        [sys.executable, "-m", "teleop", "machine", "check", *options],
        stdout=subprocess.PIPE,
        text=True,
    )
    return dict(json.loads(done.stdout))


def compare(title: str, rate: int, seconds: float, folder: Path) -> None:
    """Print the timing of the check and of a trial."""
    found = check(rate, seconds)
    trial = run(seconds, folder, ("--condition=free", f"--rate={rate}"))
    loop = trial["loop"]
    print(f"\n{title}, {rate} Hz, {seconds:g} s each: verdict {found['verdict']}")
    for name, one, ticks in (
        ("check", found, found["ticks"]),
        ("trial", loop, trial["ticks"]),
    ):
        late, tick = one["lateness_us"], one["tick_us"]["busy"]
        print(
            f"  {name}  late p50 {late['p50']:6.1f}  p99 {late['p99']:7.1f}  p99.9 "
            f"{late['p99_9']:8.1f} us; tick p50 {tick['p50']:6.1f}  p99 {tick['p99']:7.1f} us; "
            f"missed {one['skipped'] / (ticks + one['skipped']):.3%}; longest gap "
            f"{one['longest_gap_s'] * 1e3:.1f} ms"
        )
    others = found["other_programs"]
    print(f"  other programs {others['used']:.2f} processors; {'; '.join(found['reasons'])}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=30.0, help="of each measurement")
    seconds = parser.parse_args().seconds
    print(f"# python benchmarks/machine_check.py --seconds {seconds:g}, {date.today()}")
    print(f"load average {os.getloadavg()[0]:.1f} at the start")
    with tempfile.TemporaryDirectory() as name:
        for title, busy_processors in (("as it is", ()), ("busy", os.sched_getaffinity(0))):
            with contextlib.ExitStack() as stack:
                for processor in busy_processors:
                    stack.enter_context(busy(processor))
                for rate in RATES:
                    compare(title, rate, seconds, Path(name))


if __name__ == "__main__":
    main()
