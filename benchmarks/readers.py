"""Kill, stop and slow down the readers of a running trial, and measure the effect on the loop.

    python benchmarks/readers.py                     # 200 disturbed trials and as many others
    python benchmarks/readers.py --times 15 --reader estimation

Trials run in real time on the simulated rig with all readers in other processes: recorder,
estimation, live page, Foxglove, and the evaluation of the wanted precision. At a random time, one
reader is disturbed: it is killed (SIGKILL), stopped (SIGSTOP) and continued after a random time, or
slowed down, that is, it runs 5 of 50 ms. The trials with a disturbance alternate with trials
without one. These are measured from a random time, too. For both, the percentiles of the lateness
of the ticks from this time on are printed, and the median of the ratio of the percentiles in two
successive trials with its 95 % interval. If the whole interval is above 1, the exit code is 1.

Every trial must satisfy these rules. If one does not, the exit code is 1.

- Every tick is recorded with the values that the loop wrote. A recorder that was killed may have
  lost the ticks of the last 100 ms before that.
- The trial ends early if and only if the recorder was killed, and it ends with a ramp.
- There is no fault. If the estimation was killed, an event states it.

A trial that the loop stopped because it was late (overrun), as on a busy machine, is repeated.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import random
import shlex
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from watched_trial import MODULES, Announcement, WatchedTrial

from teleop.control.wanted_precision import WantedPrecision
from teleop.recording.mcap_reader import read_intact
from teleop.safety import Fault
from teleop.settings.simulated_rig_limits import BRAKING_TIME
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.message import tick_values
from teleop.trial import run as run_module
from teleop.trial.live_link import LiveLink
from teleop.trial.readers import CHECK, ESTIMATION
from teleop.trial.run import run_trial

ACTIONS = ("kill", "stop", "slow down")
DURATION = 3.0
"""Duration of a trial [s]. A disturbance begins in the first half."""
FIRST, LAST = 0.3, 1.3
"""Earliest and latest beginning of a disturbance after the drives were armed [s]."""
LONGEST = 1.2
"""Longest time for which a reader is stopped or slowed down [s]."""
RUNS, PAUSES = 5e-3, 45e-3
"""Times for which a slow reader runs, and does not run [s]."""
LOST = 0.1
"""Largest loss of a killed recorder [s]."""
LATE = 0.05
"""Allowed lateness on a busy machine of the end of a trial whose recorder was killed [s]."""
RATE = 1000.0
RESAMPLED = 2000
"""Number of samples of the bootstrap."""
PERCENTILES = (50.0, 99.0, 100.0)
REPEATS = 5
"""Largest number of repetitions of a trial in which the loop was late."""


def run(path: str) -> None:
    """Run a trial with all readers. This process writes two lines, see `WatchedTrial`."""
    run_module.check_rate = lambda settings, real: None
    settings = TrialSettings(
        condition="free", duration=DURATION, until=WantedPrecision(k=1e-6), rate=RATE
    )
    choices: dict[str, list[Any]] = {"condition": [], "specimen": [], "duration": []}
    live = LiveLink("127.0.0.1", 0, False, False, choices, foxglove=0)
    try:
        trial = run_trial(
            settings, Path(path), real="try", live=live, viewers=[Announcement()], overwrite=True
        )
    finally:
        live.end()
    print(json.dumps({"problem": trial.outcome.problem, "dropped": trial.outcome.dropped}))


class Result(NamedTuple):
    """Result of a trial."""

    late: np.ndarray
    """Lateness of the ticks from the disturbance on [s]."""
    lost: float
    """Time before the disturbance whose ticks are not recorded [s]."""
    problems: list[str]
    missed: dict[str, int]
    overran: bool
    """Whether the loop stopped because it was late."""


def disturb(pid: int, action: str, seconds: float) -> None:
    """Kill a process; or stop it or slow it down for some time."""
    if action == "kill":
        os.kill(pid, signal.SIGKILL)
        return
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0.0:
        os.kill(pid, signal.SIGSTOP)
        time.sleep(left if action == "stop" else min(PAUSES, left))
        os.kill(pid, signal.SIGCONT)
        time.sleep(0.0 if action == "stop" else RUNS)


def measured(path: Path, reader: str, action: str) -> Result:
    """Run a trial in which a reader is disturbed; without an action, none is."""
    trial = WatchedTrial(__file__, "--run", str(path))
    try:
        trial.wait_until_armed()
        time.sleep(random.uniform(FIRST, LAST))
        begin = trial.stream.ticks.newest
        if action:
            disturb(trial.readers[reader], action, random.uniform(0.1, LONGEST))
        end = trial.wait()
    finally:
        trial.process.kill()
        trial.process.wait()
        trial.clean_up()
    columns = trial.columns()
    killed = reader if action == "kill" else ""
    recorded = recorded_rows(path)
    lost = max(begin - len(recorded), 0) / RATE
    problems = [
        *lost_ticks(recorded, trial, killed, lost),
        *wrong_end(columns, trial, killed, begin),
    ]
    if not end and killed != "recorder":
        problems.append("the process of the trial has failed")
    faults = {event["fault"] for event in trial.events} - {None}
    overran = str(Fault.OVERRUN) in faults
    if faults:
        problems.append(f"faults {', '.join(faults)}")
    return Result(columns["lateness"][begin:], lost, problems, trial.missed, overran)


def recorded_rows(path: Path) -> np.ndarray:
    """Return the recorded ticks, shape (ticks, columns)."""
    contents = read_intact(path)
    return tick_values(np.frombuffer(contents.messages, np.uint8).reshape(-1, contents.size)).T


def lost_ticks(recorded: np.ndarray, trial: WatchedTrial, killed: str, lost: float) -> list[str]:
    """Return a text if ticks are not recorded as the loop wrote them."""
    written = trial.stream.rows(1, trial.stream.ticks.newest + 1)[2]
    if killed == "recorder":
        if lost > LOST:
            return [f"{lost * 1e3:.0f} ms before the kill are lost"]
    elif len(recorded) != len(written):
        return [f"{len(recorded)} of {len(written)} ticks are recorded"]
    of_loop = trial.stream._loop
    if not np.array_equal(recorded[:, of_loop], written[: len(recorded), of_loop], equal_nan=True):
        return ["other values are recorded than those of the loop"]
    return []


def wrong_end(
    columns: dict[str, np.ndarray], trial: WatchedTrial, killed: str, begin: int
) -> list[str]:
    """Return a text if the trial did not end as it should."""
    problems = []
    moves = np.flatnonzero(columns["commanded_slave_velocity"])
    stop = columns["time"][moves[-1]]
    armed = trial.armed or 0.0
    if killed != "recorder":
        if stop - armed < DURATION - 0.1:
            problems.append(f"ended after {stop - armed:.3f} s")
    else:
        took = stop - columns["time"][begin - 1]
        if took > CHECK + BRAKING_TIME + LATE:
            problems.append(f"ended {took * 1e3:.0f} ms after the kill")
    steps = np.abs(np.diff(columns["commanded_slave_velocity"]))
    largest = TrialSettings().limits.max_acceleration * columns["dt"][1:]
    if np.any(steps > largest * (1.0 + 1e-9) + 1e-12):
        problems.append("the trial did not end with a ramp")
    noted = any(event["source"] == ESTIMATION for event in trial.events)
    if killed == "estimation" and not noted:
        problems.append("no event states that the estimation was killed")
    return problems


def repeated(folder: Path, reader: str, action: str) -> tuple[Result, int]:
    """Return the result of a trial, and how often it was repeated because the loop was late."""
    repeats = -1
    overran = True
    while overran and repeats < REPEATS:
        repeats += 1
        result = measured(folder / "trial.mcap", reader, action)
        overran = result.overran
    return result, repeats


def ratio(disturbed: list[float], quiet: list[float]) -> tuple[float, float, float]:
    """Return the median of the ratios, and its 95 % interval by bootstrap."""
    ratios = np.array(disturbed) / np.maximum(quiet, 1e-9)
    sampled = np.random.default_rng(0).choice(ratios, (RESAMPLED, len(ratios)))
    low, high = np.percentile(np.median(sampled, axis=1), (2.5, 97.5))
    return float(np.median(ratios)), float(low), float(high)


def report(results: dict[bool, list[np.ndarray]]) -> bool:
    """Print the lateness with and without a disturbance; return whether the loop is not later."""
    print("lateness of the loop [us]" + "".join(f"{f'p{p:g}':>10}" for p in PERCENTILES))
    for disturbed, late in results.items():
        values = np.percentile(np.concatenate(late), PERCENTILES) * 1e6
        title = "a reader is disturbed" if disturbed else "no disturbance"
        print(f"{title:25}" + "".join(f"{value:10.2f}" for value in values))
    good = True
    for p in PERCENTILES[:2]:
        pairs = [[float(np.percentile(late, p)) for late in results[key]] for key in (True, False)]
        middle, low, high = ratio(*pairs)
        same = low <= 1.0
        good &= same
        print(
            f"p{p:g} of a trial, median of the ratio to the next one without a disturbance: "
            f"{middle:.2f} (95 % interval {low:.2f} to {high:.2f}): "
            f"{'not later' if same else 'later'}"
        )
    return good


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--times", type=int, default=200, help="number of disturbed trials")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reader", choices=[*MODULES.values()], help="only this one")
    parser.add_argument("--action", choices=ACTIONS, help="only this disturbance")
    parser.add_argument("--run", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run:
        run(options.run)
        return 0
    random.seed(options.seed)
    print(f"# python {shlex.join(sys.argv)}, {date.today()}")
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors")
    readers = [options.reader] if options.reader else [*MODULES.values()]
    kinds = itertools.cycle(
        itertools.product(readers, [options.action] if options.action else ACTIONS)
    )
    late: dict[bool, list[np.ndarray]] = {True: [], False: []}
    lost: dict[tuple[str, str], list[float]] = defaultdict(list)
    missed: Counter[str] = Counter()
    problems: dict[tuple[str, str], list[str]] = defaultdict(list)
    repeats = 0
    with tempfile.TemporaryDirectory() as name:
        for kind in itertools.islice(kinds, options.times):
            for reader, action in (kind, ("", "")):
                result, again = repeated(Path(name), reader, action)
                late[bool(action)].append(result.late)
                lost[reader, action].append(result.lost)
                problems[reader, action] += result.problems
                missed.update(result.missed)
                repeats += again
    print(f"{'reader':<12}{'disturbance':<14}{'trials':>7}{'lost before [ms]':>18}{'problems':>10}")
    for (reader, action), losses in lost.items():
        found = problems[reader, action]
        print(
            f"{reader or 'none':<12}{action or 'none':<14}{len(losses):>7}"
            f"{max(losses) * 1e3:>18.0f}{len(found):>10}"
        )
        for text in found[:3]:
            print(f"    {text}")
    print(
        f"ticks missed by the readers: {dict(missed - Counter(python=missed['python'])) or 'none'}"
    )
    print(f"trials repeated because the loop was late: {repeats}")
    same = report(late)
    return 0 if same and not any(problems.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
