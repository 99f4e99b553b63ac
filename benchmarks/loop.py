"""Measure the lateness of the live loop, compared with cyclictest and loop-rate-limiters.

    python benchmarks/loop.py
    python benchmarks/loop.py --seconds 600 --cases "4000|board"

Each case takes 30 s: an idle machine, a busy second processor at 1 kHz and at 4 kHz, an emulated
serial board at 2 kHz, and loop-rate-limiters. The loop is `teleop run` with its recorder. At the
same time, cyclictest (package rt-tests of Debian) measures the kernel's wake-ups at the same rate
and priority on the other processor. The board is emulated on this processor too. A wake-up that is
late by n periods would have skipped n periods of a loop: this number stands beside the periods that
the loop has skipped.
`soak.py` runs the loop for a long time.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from emulated import emulated

RATE = 1000
BOARD_RATE, FAST_RATE = 2000, 4000
"""Rates on the emulated serial board, and of a fast loop on the simulated rig [Hz]."""
SIMULATED = ("--condition=free",)


@contextmanager
def busy(processor: int) -> Iterator[None]:
    """Run a process that keeps a processor busy."""
    code = f"import os\nos.sched_setaffinity(0, {{{processor}}})\nwhile True: pass"
    process = subprocess.Popen([sys.executable, "-c", code])
    try:
        yield
    finally:
        process.kill()
        process.wait()


def cyclictest(seconds: float, processor: int, rate: int) -> subprocess.Popen[str] | None:
    """Start cyclictest; return None if it is not installed."""
    if not shutil.which("cyclictest"):
        print("cyclictest is not installed (Debian: rt-tests): nothing to compare with")
        return None
    options = ["-q", "-m", "-p", "80", "-i", str(1_000_000 // rate), "-h", "20000", "-t", "1"]
    return subprocess.Popen(
        ["cyclictest", *options, "-a", str(processor), "-D", str(int(seconds))],
        stdout=subprocess.PIPE,
        text=True,
    )


def percentiles(histogram: str, rate: int) -> dict[str, float]:
    """Return the percentiles of lateness [us] from the output of cyclictest.

    `skipped` is the number of periods that a loop of this rate [Hz] would have skipped.
    """
    rows = [line.split() for line in histogram.splitlines() if line[:1].isdigit()]
    late = np.array([int(row[0]) for row in rows])
    counts = np.array([int(row[1]) for row in rows])
    share = np.cumsum(counts) / counts.sum()
    top = next(line for line in histogram.splitlines() if "Max Latencies" in line)
    return {
        "p50": float(late[np.searchsorted(share, 0.5)]),
        "p99": float(late[np.searchsorted(share, 0.99)]),
        "p99_9": float(late[np.searchsorted(share, 0.999)]),
        "max": float(top.split(":")[1]),
        "skipped": float(np.sum(counts * (late * rate // 1_000_000))),
    }


def run(seconds: float, folder: Path, rig: tuple[str, ...]) -> dict[str, Any]:
    """Run `teleop run` with the options `rig`, and return its summary."""
    path = folder / f"{time.time_ns()}.mcap"
    command = ["run", "--duration", str(seconds), "--record", str(path), "--json", *rig]
    done = subprocess.run(
        [sys.executable, "-m", "teleop", *command], stdout=subprocess.PIPE, text=True
    )
    if done.returncode:
        print(done.stdout)
        raise SystemExit(f"teleop run ended with {done.returncode}")
    return dict(json.loads(done.stdout))


def compare(
    title: str,
    seconds: float,
    folder: Path,
    load: bool = True,
    rate: int = RATE,
    rig: tuple[str, ...] = SIMULATED,
) -> None:
    """Run the loop with the options `rig` and cyclictest at the same time, and print the result."""
    processors = sorted(os.sched_getaffinity(0))
    other = processors[0]
    with busy(other) if load else nullcontext():
        peer = cyclictest(seconds, other, rate)
        summary = run(seconds, folder, rig)
        kernel = percentiles(peer.communicate()[0], rate) if peer else None
    loop = summary["loop"]
    late, tick = loop["lateness_us"], loop["tick_us"]
    periods = summary["ticks"] + loop["skipped"]
    print(f"\n{title}, {rate} Hz, {seconds:g} s")
    print(
        f"  loop        p50 {late['p50']:8.1f}  p99 {late['p99']:8.1f}  "
        f"p99.9 {late['p99_9']:8.1f}  max {late['max']:8.1f} us late"
    )
    if kernel:
        print(
            f"  cyclictest  p50 {kernel['p50']:8.1f}  p99 {kernel['p99']:8.1f}  "
            f"p99.9 {kernel['p99_9']:8.1f}  max {kernel['max']:8.1f} us late\n"
            f"  ratio of the p99: {late['p99'] / kernel['p99']:.2f}; periods skipped: loop "
            f"{loop['skipped']}, cyclictest {kernel['skipped']:.0f}"
        )
    print(
        f"  mean rate {loop['mean_rate_hz']:.4f} Hz, with the {loop['skipped']} skipped periods "
        f"{loop['mean_rate_hz'] * periods / summary['ticks']:.4f} Hz; "
        f"{loop['overruns']} overruns; {summary['recording']['dropped']} ticks dropped"
    )
    print(
        f"  a tick takes p50 {tick['busy']['p50']:.1f}, p99 {tick['busy']['p99']:.1f} us: read "
        f"{tick['read']['p50']:.1f}, compute {tick['compute']['p50']:.1f}, write "
        f"{tick['write']['p50']:.1f}, the rest is packing and pushing"
    )
    print(f"  lateness: {histogram(loop['lateness_histogram'])}")


def histogram(counted: dict[str, Any]) -> str:
    """Return a histogram of lateness on one line."""
    names = [f"<{bound:g} us" for bound in counted["bounds_us"]] + ["more"]
    pairs = zip(names, counted["ticks"], strict=True)
    return ", ".join(f"{name} {count}" for name, count in pairs if count)


def limiter(seconds: float) -> None:
    """Run the peer, loop-rate-limiters, with an empty body."""
    try:
        from loop_rate_limiters import RateLimiter
    except ImportError:
        print("\nloop-rate-limiters is not installed: pip install '.[dev]'")
        return
    rate = RateLimiter(frequency=RATE, warn=False)
    ticks = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        ticks.append(time.perf_counter())
        time.sleep(0.0)
        rate.sleep()
    t = np.array(ticks) - ticks[0]
    late = (t - np.arange(len(t)) / RATE) * 1e6
    print(
        f"\nloop-rate-limiters, an empty body, {seconds:g} s\n"
        f"  mean rate {(len(t) - 1) / t[-1]:.4f} Hz; behind the schedule at the end by "
        f"{late[-1] / 1e3:.1f} ms; step between ticks p99 "
        f"{np.percentile(np.diff(t), 99) * 1e6:.0f} us"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=30.0, help="of each short comparison")
    parser.add_argument("--cases", default="", help="regular expression of the names of the cases")
    options = parser.parse_args()
    seconds, wanted = options.seconds, re.compile(options.cases)
    print(f"# python benchmarks/loop.py {shlex.join(sys.argv[1:])}, {date.today()}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if wanted.search("idle machine"):
            compare("idle machine", seconds, folder, load=False)
        if wanted.search("second core busy"):
            compare("second core busy", seconds, folder)
        if wanted.search("4000 Hz"):
            fast = (*SIMULATED, f"--rate={FAST_RATE}")
            compare("second core busy", seconds, folder, rate=FAST_RATE, rig=fast)
        if wanted.search("serial board"):
            with emulated("serial-board", rate=BOARD_RATE) as file:
                trial = (f"--rig={file}", "--condition=autonomous", "--specimen=soft")
                board = (*trial, "--depth=10.3mm", "--yes")
                compare("serial board", seconds, folder, load=False, rate=BOARD_RATE, rig=board)
        if wanted.search("loop-rate-limiters"):
            limiter(seconds)


if __name__ == "__main__":
    main()
