"""Measure how old the estimates on the live page are, and what the readers of a trial need.

    python benchmarks/stream.py                      # 20 s of each case
    python benchmarks/stream.py --seconds 5 --rate 1000

A trial runs in real time on the simulated rig with three and with all estimators, at 1 and 4 kHz.
It is recorded, and a page is open. For each case, these values are printed:

- the age of the estimates at the page: the time from the moment at which the loop wrote the tick
  until this process has received its row with estimates. The page receives 60 messages per second.
  `newest` is the age of the newest row of a message, and `all` is that of all rows, which includes
  the time that a row waits for the next message;
- how far the estimation is behind the loop, sampled 200 times per second;
- the share of a processor that each process uses;
- the lateness of the loop, and the ticks that each reader has missed.

The processor time of the estimation for one sample is measured apart, in blocks of different sizes.
The process of the estimation reads every 2 ms, that is, 2 ticks at 1 kHz and 8 at 4 kHz.

The aim is that the age of the newest estimates is less than 15 ms (99th percentile). The exit code
is 1 if it is not, or if a reader has missed ticks. The last line is the number of lines of the
product that changed since the version `--since`, in which the loop computed the estimates.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import shlex
import struct
import subprocess
import sys
import tempfile
import time
from datetime import date
from itertools import product
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from live_session import Page, connected, now
from watched_trial import Announcement, WatchedTrial, processor_time

from estimation.registry import BUILT_IN
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.estimation import Estimation
from teleop.trial import run as run_module
from teleop.trial.live_link import LiveLink
from teleop.trial.run import run_trial

AIM = 15e-3
"""Largest 99th percentile of the age of the newest estimates [s]."""
WARM = 2.0
"""Time before the measurement [s]."""
SAMPLED = 5e-3
"""Time between two samples of the delay of the estimation [s]."""
BLOCKS = (1, 2, 8, 20, 50, 200)
"""Numbers of samples that the estimation processes together."""
BEFORE = "fa7860a4"
"""The last version in which the loop computed the estimates."""
ESTIMATORS = {"three": ("rls", "ai", "me"), "all": tuple(BUILT_IN)}


def run(path: str, seconds: float, estimators: str, rate: float) -> None:
    """Run a trial with a live page. This process writes two lines, see `WatchedTrial`."""
    run_module.check_rate = lambda settings, real: None
    settings = TrialSettings(
        duration=seconds + WARM + 2.0, estimators=ESTIMATORS[estimators], rate=rate
    )
    choices: dict[str, list[Any]] = {"condition": [], "specimen": [], "duration": []}
    live = LiveLink("127.0.0.1", 0, False, False, choices)
    try:
        viewers = [Announcement(url=live.url)]
        trial = run_trial(settings, Path(path), real="try", live=live, viewers=viewers)
    finally:
        live.end()
    fault = trial.fault["text"] if trial.fault else ""
    print(json.dumps({"fault": fault, "problem": trial.outcome.problem}))


class TimedPage(Page):
    """A page that measures the age of the rows with estimates when it receives them."""

    def __init__(self, connection: Any) -> None:
        super().__init__(connection)
        self.newest: list[float] = []
        """Age of the newest estimates of each message [s]."""
        self.ages: list[float] = []
        """Age of all estimates [s]."""

    async def _receive(self) -> None:
        async for message in self.connection:
            arrived = now()
            if not isinstance(message, bytes):
                document = json.loads(message)
                if document["type"] == "welcome":
                    self.names = [column["name"] for column in document["columns"]]
                continue
            _, count, columns, _, self.seen = struct.unpack_from("<IIIId", message)
            rows = np.frombuffer(message, "<f8", offset=24).reshape(count, columns)
            estimated = rows[~np.isnan(rows[:, self.names.index("rls_k")])]
            if len(estimated):
                ages = (arrived - estimated[:, -1]).tolist()
                self.newest.append(ages[-1])
                self.ages += ages


async def watch(trial: WatchedTrial, seconds: float) -> tuple[TimedPage, list[int]]:
    """Open a page for a time; return it, and how many ticks the estimation was behind."""
    address, token = trial.begun["url"].removeprefix("http://").split("/#t=")
    behind = []
    async with connected(address, token, TimedPage) as page:
        await asyncio.sleep(0.5)
        page.newest.clear()
        page.ages.clear()
        end = now() + seconds
        while now() < end:
            behind.append(trial.stream.ticks.newest - trial.stream.estimates.newest)
            await asyncio.sleep(SAMPLED)
    return page, behind


def print_line(title: str, values: np.ndarray, unit: str) -> None:
    middle, high, most = np.percentile(values, (50, 99, 100))
    print(f"  {title:30} p50 {middle:7.1f}  p99 {high:7.1f}  max {most:7.1f} {unit}")


def shares(trial: WatchedTrial) -> dict[str, float]:
    """Return the processor time of each process of a trial so far [s]."""
    pids = {"loop": trial.process.pid, **trial.readers}
    return {name: processor_time(pid) for name, pid in pids.items()}


def measure(path: Path, seconds: float, estimators: str, rate: float) -> bool:
    """Print the values of a case; return whether they are as they should be."""
    command = ("--run", str(path), "--seconds", str(seconds), "--rate", str(rate))
    trial = WatchedTrial(__file__, *command, "--estimators", estimators)
    try:
        trial.wait_until_armed()
        time.sleep(WARM)
        before, begin, first = shares(trial), now(), trial.stream.ticks.newest
        page, behind = asyncio.run(watch(trial, seconds))
        used = {name: used - before[name] for name, used in shares(trial).items()}
        passed = now() - begin
        end = trial.wait()
    except OSError:  # the trial has ended
        print(f"\n{estimators} estimators, {rate:g} Hz: ended early: {trial.wait()}", flush=True)
        return False
    finally:
        trial.process.kill()
        trial.clean_up()
    missed = {name: count for name, count in trial.missed.items() if count and name != "python"}
    late = trial.columns()["lateness"][-(trial.stream.ticks.newest - first) :] * 1e6
    print(f"\n{estimators} estimators, {rate:g} Hz, {seconds:g} s, load {os.getloadavg()[0]:.1f}")
    for title, ages in (("newest", page.newest), ("all", page.ages)):
        print_line(f"age of the estimates, {title}", np.array(ages or [np.nan]) * 1e3, "ms")
    print_line("estimation behind the loop", np.array(behind) / rate * 1e3, "ms")
    print_line("lateness of the loop", late, "us")
    texts = (f"{name} {100.0 * seconds / passed:.1f} %" for name, seconds in used.items())
    print(f"  share of a processor: {', '.join(texts)}")
    print(f"  missed ticks: {', '.join(f'{n} {c}' for n, c in missed.items()) or 'none'}")
    if end.get("fault") or end.get("problem"):
        print(f"  stopped: {end}")
    good = bool(page.newest) and np.percentile(page.newest, 99) < AIM
    return bool(good and not missed and not end.get("fault"))


def print_costs(estimators: str) -> None:
    """Print the processor time of the estimation for a sample, in blocks of each size."""
    settings = TrialSettings(clock="virtual", duration=4.0, estimators=ESTIMATORS[estimators])
    recording = run_trial(settings).recording
    pairs = np.array([recording[f"paired_{name}"] for name in ("position", "force", "dt")])
    pairs = pairs[:, ~np.isnan(pairs[2])]
    texts = []
    for block in BLOCKS:
        estimation = Estimation(settings.make_conditioner(), settings.estimation_preset.bank())
        parts = [pairs[:, i : i + block] for i in range(0, pairs.shape[1], block)]
        warm = len(parts) // 4
        for part in parts[:warm]:
            estimation.rows(*part)
        start = process_time()
        for part in parts[warm:]:
            estimation.rows(*part)
        spent = (process_time() - start) / sum(part.shape[1] for part in parts[warm:])
        texts.append(f"{spent * 1e6:.0f} us ({block})")
    print(f"{estimators} estimators, a sample in blocks of a size: {', '.join(texts)}", flush=True)


def changed_lines(since: str) -> str:
    """Return how many lines of the product were added and removed since a version."""
    done = subprocess.run(
        ["git", "diff", "--numstat", since, "--", "teleop/*.py"],
        cwd=Path(__file__).parent.parent,
        capture_output=True,
        text=True,
    )
    counts = [line.split()[:2] for line in done.stdout.splitlines()]
    added, removed = (sum(int(pair[i]) for pair in counts) for i in (0, 1))
    return (
        f"lines of teleop/ since {since}: {added} added, {removed} removed ({added - removed:+d})"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="of each case")
    parser.add_argument("--rate", type=float, action="append", help="only this rate [Hz]")
    parser.add_argument("--estimators", choices=[*ESTIMATORS], help="only these")
    parser.add_argument("--since", default=BEFORE, help="version to compare the lines with")
    parser.add_argument("--run", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run:
        run(options.run, options.seconds, options.estimators, options.rate[0])
        return 0
    print(f"# python {shlex.join(sys.argv)}, {date.today()}")
    for estimators in ESTIMATORS:
        print_costs(estimators)
    good = True
    cases = product([options.estimators] if options.estimators else ESTIMATORS,
                    options.rate or (1000.0, 4000.0))  # fmt: skip
    for estimators, rate in cases:
        with tempfile.TemporaryDirectory() as folder:
            good &= measure(Path(folder) / "trial.mcap", options.seconds, estimators, rate)
    print(f"\n{changed_lines(options.since)}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
