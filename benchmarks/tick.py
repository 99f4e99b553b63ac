"""Time of each stage of a tick, in virtual time and live: `python benchmarks/tick.py`.

Trials run in virtual time with the ticks stored in memory, live on the simulated rig with the
recorder, and live on an emulated serial board with the recorder. Each is run twice: first only the
whole tick is measured, and then its stages. `--against` is the folder with the source of another
version, which is measured in the same run, in turn with this version, by its own copy of this
program. The rehearsal before a trial is left out, because it ends the trial if other programs keep
the machine busy. The condition is free on the simulated rig, and autonomous on the board.

The readers are the recorder and the estimation. Live, they are other processes. In virtual time,
they read many ticks at once, so that they are not part of the percentiles. For this reason, the
processor time of all ticks, divided by their number, is printed too. It is the smallest of several
trials in processes that have run a trial before.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from emulated import emulated

from drivers.rig_file import read_rig_file
from sim_backend import DEPTH
from teleop.control import controller as controller_module
from teleop.safety import Mode
from teleop.settings.trial_settings import TrialSettings
from teleop.trial import run as run_module
from teleop.trial.loop import Loop
from teleop.trial.run import run_trial

CASES = ("virtual", "live, simulated", "live, board")
WHOLE, REST, MEAN = "whole tick", "rest, and the probes", "processor time"
STAGES = (
    "requests of a person",
    "read the rig",
    "condition and link",
    "supervision",
    "command the drives",
    "alignment",
    "write to the stream",
    "readers",
)
RETURN = 2.0
"""Time after a trial in which the emulated rig returns to its initial position [s]."""
ATTEMPTS = 3
"""Number of times that a measurement is tried, because a busy machine may stop a trial."""
WARM = 1000
"""Number of active ticks before the measured ticks."""
Durations = dict[str, list[float]]


class Probes:
    """Measures the durations of the stages of the active ticks of a loop.

    Parameters
    ----------
    loop
        The loop, before its first tick.
    stages
        Whether the stages are also measured, and not only the whole tick.

    Attributes
    ----------
    durations
        Duration of each stage in each active tick [s].
    """

    def __init__(self, loop: Loop, stages: bool) -> None:
        self.durations: Durations = {}
        self._loop, self._step = loop, loop.step
        self._spent = dict.fromkeys(("wait", *STAGES) if stages else ("wait",), 0.0)
        self._probe(loop._clock, "wait", "wait")
        loop.step = self.step  # type: ignore[method-assign]
        if stages:
            self._probe_stages(loop)

    def _probe_stages(self, loop: Loop) -> None:
        parts = loop.controller
        self._probe(loop._switch, "request", "requests of a person")
        self._probe(parts._rig, "read", "read the rig")
        for name in ("drive_force", "target"):
            self._probe(parts._condition, name, "condition and link")
        for name in ("step", "follow", "observe", "stiffness"):
            self._probe(parts._link, name, "condition and link")
        self._probe(controller_module, "supervise", "supervision")
        self._probe(parts._rig, "write", "command the drives")
        self._probe(parts._alignment, "update", "alignment")
        self._probe(loop._stream, "write", "write to the stream")
        self._probe(loop._readers, "after_tick", "readers")

    def _probe(self, owner: Any, name: str, stage: str) -> None:
        """Replace a function of an object or a module by a function that measures its duration."""
        original: Callable[..., Any] = getattr(owner, name)
        original = getattr(original, "probed", original)
        spent = self._spent

        def probed(*arguments: Any) -> Any:
            start = perf_counter()
            result = original(*arguments)
            spent[stage] += perf_counter() - start
            return result

        probed.probed = original  # type: ignore[attr-defined]
        setattr(owner, name, probed)

    def step(self) -> bool:
        """Run one tick and store the durations of its stages."""
        start = perf_counter()
        goes_on = self._step()
        spent = self._spent
        whole = perf_counter() - start - spent.pop("wait")
        if self._loop.controller.mode is Mode.ACTIVE:
            rest = whole - sum(spent.values())
            for stage, seconds in {**spent, REST: rest, WHOLE: whole}.items():
                self.durations.setdefault(stage, []).append(seconds)
        spent.update(dict.fromkeys(("wait", *spent), 0.0))
        return goes_on


def measure(case: str, seconds: float, rig: str) -> Durations:
    """Return the duration of the whole tick and of its stages in each tick of two trials [s]."""
    found: list[Probes] = []
    mean: list[float] = []
    run = Loop.run
    run_module.check_rate = lambda settings, real: None
    run_module.check_wire = lambda rig, clock, cost: None
    settings = TrialSettings(
        condition="autonomous" if rig else "free",
        duration=max(seconds, 10.0 if case == "virtual" else 0.0) + WARM / 1000.0,
        clock="virtual" if case == "virtual" else "real",
        rig=read_rig_file(Path(rig)) if rig else None,
        specimen="soft" if rig else "",
        depth=DEPTH["injector"]["soft"] if rig else None,
    )
    if case == "virtual":  # as in a sweep, of which only the first trials load numba
        with suppress(ImportError):
            import_module("numba")
        run_trial(settings)
    with tempfile.TemporaryDirectory() as folder:
        for stages in (False, True):

            def probed_run(loop: Loop, stages: bool = stages) -> None:
                found.append(Probes(loop, stages))
                start = process_time()
                run(loop)
                if case == "virtual" and not stages:
                    loop._readers.close()
                    mean.append((process_time() - start) / loop.ticks)

            Loop.run = probed_run  # type: ignore[method-assign]
            path = Path(folder) / f"{stages}.mcap" if case != "virtual" else None
            if rig:
                time.sleep(RETURN)
            trial = run_trial(settings, path, real="try" if path else "off", arm=True)
            if trial.fault:
                raise SystemExit(f"{case}: stopped: {trial.fault['text']}")
    plain, staged = (probes.durations for probes in found)
    return {**staged, WHOLE: plain[WHOLE], MEAN: mean}


def in_process(tree: Path | None, case: str, seconds: float, rig: Path | None) -> Durations:
    """Measure a version in another process, and return the durations; empty if no attempt works."""
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1")
    program = Path(__file__)
    if tree:
        environment["PYTHONPATH"] = str(tree)
        program = tree / "benchmarks" / program.name
    command = [sys.executable, str(program), "--case", case, "--seconds", str(seconds)]
    command += ["--rig", str(rig or "")]
    for _ in range(ATTEMPTS):
        done = subprocess.run(command, env=environment, cwd=tree, stdout=subprocess.PIPE)
        if done.returncode == 0:
            durations: Durations = json.loads(done.stdout)
            return durations
    return {}


def table(title: str, of_cases: dict[str, Durations]) -> None:
    """Print the percentiles of each stage in each case."""
    print(f"\n{title}, p50 and p99 [us]")
    print(f"{'':24}" + "".join(f"{case:>18}" for case in of_cases))
    found = dict.fromkeys(stage for durations in of_cases.values() for stage in durations)
    others = [stage for stage in found if stage not in (*STAGES, REST, WHOLE, MEAN)]
    for stage in (*STAGES, *others, REST, WHOLE):
        cells = ""
        for durations in of_cases.values():
            middle, high = np.percentile(durations.get(stage, [np.nan]), (50, 99)) * 1e6
            cells += f"{middle:10.1f}{high:8.1f}"
        print(f"{stage:24}{cells}")
    if means := of_cases["virtual"].get(MEAN):
        print(f"{MEAN:24}{min(means) * 1e6:10.1f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=3.0, help="of each measured trial")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--against", type=Path, help="folder with the source of another version")
    parser.add_argument("--case", choices=CASES, help=argparse.SUPPRESS)
    parser.add_argument("--rig", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.case:
        print(json.dumps(measure(options.case, options.seconds, options.rig)))
        return
    versions: dict[str, Path | None] = {"this version": None}
    if options.against:
        versions["other version"] = options.against.absolute()
    found: dict[str, dict[str, Durations]] = {
        title: {case: {} for case in CASES} for title in versions
    }
    for case in CASES:
        for _ in range(options.rounds):
            for title, tree in versions.items():
                run = partial(in_process, tree, case, options.seconds)
                if case == "live, board":
                    with emulated("serial-board") as rig:
                        durations = run(rig)
                else:
                    durations = run(None)
                for stage, measured in durations.items():
                    skipped = 0 if stage == MEAN else WARM
                    found[title][case].setdefault(stage, []).extend(measured[skipped:])
    print(
        f"{options.rounds} times {options.seconds:g} s at 1 kHz in each case, "
        f"load average {os.getloadavg()[0]:.1f}"
    )
    for title, of_cases in found.items():
        table(title, of_cases)


if __name__ == "__main__":
    main()
