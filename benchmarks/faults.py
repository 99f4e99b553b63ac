"""Run the fault campaign: inject every kind of fault at random times under every condition.

    python benchmarks/faults.py                     # 200 times per kind and condition
    python benchmarks/faults.py --instants 50
    python benchmarks/faults.py --instants 0 --real 2    # in real time, twice each
    python benchmarks/faults.py --law model-mediated     # only with this force feedback
    python benchmarks/faults.py --page with              # only with the live page

In virtual time, a trial runs once for each law of force feedback, condition and cube, without the
live page and with a live page in which the drives are armed. The server of this page runs in the
process of the trial, on the virtual time; in real time, the live process and the page are two other
processes. The trials with force feedback have a communication channel, and settings for which the
law is stable. At each of the random times, the process forks, and the fault is injected in the
child process. The commands to the drives and the true contact force are read from the simulated
plant, not from the controller's measurements. For each kind of fault, these values are printed: the
number of cases and how many had a live page, the longest time to standstill, the limit of this
time, and the largest overshoot over the hard force limit. The exit code is 1 if any case differs
from docs/safety.md.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import shlex
import sys
import tempfile
import time
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from fault_case import CampaignClock, Case
from fault_kinds import CHANNEL, KINDS, PERIOD, late_jumps
from fault_run import run_case
from page_in_process import InProcess
from page_process import PageProcess
from private_stream import private_stream

from sim_backend.faults import FaultyRig
from teleop.control.admittance import AdmittanceParameters
from teleop.control.clock import Tick
from teleop.control.feedback.settings import FeedbackSettings
from teleop.names import FeedbackName
from teleop.safety import Fault
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import Stream
from teleop.trial.assembly import make_clock, make_rig
from teleop.trial.realtime import realtime

CUBES = ("soft", "medium", "hard")


class Trials(NamedTuple):
    """Trials with one law of force feedback, in which faults are injected."""

    conditions: tuple[str, ...] = ("free", "mimic")
    cubes: tuple[str, ...] = CUBES
    admittance: AdmittanceParameters = AdmittanceParameters()


TRIALS: dict[FeedbackName, Trials] = {
    "none": Trials(conditions=("free", "mimic", "autonomous")),
    "model-mediated": Trials(),
    "position-force": Trials(cubes=("soft",), admittance=AdmittanceParameters(damping=200.0)),
}
LATE = 0.02
"""Allowed lateness of a tick in real time on a machine that other programs use too [s]."""
BUSY = (str(Fault.OVERRUN), str(Fault.DRIVE_ERROR))
"""Faults of a loop that was late: its own, and that of the watchdogs of the drives."""
PAGE_LATE = 0.3
"""Allowed time from a command to the process with the page until its effect, in real time [s]."""


def possible(names: list[str], law: FeedbackName, page: bool) -> list[str]:
    """Return the kinds of fault that are possible with a law, with or without the live page."""
    return [
        name
        for name in names
        if (law != "none" or not KINDS[name].linked) and (page or not KINDS[name].paged)
    ]


def settings_of(condition: str, cube: str, law: FeedbackName, **more: Any) -> TrialSettings:
    """Return the settings of a trial with a law of force feedback."""
    return TrialSettings(
        condition=condition,
        cube=cube,
        feedback=FeedbackSettings(law),
        admittance=TRIALS[law].admittance,
        channel=None if law == "none" else CHANNEL,
        **more,
    )


def virtual(
    condition: str,
    cube: str,
    names: list[str],
    instants: int,
    seed: int,
    law: FeedbackName,
    page: bool = False,
) -> list[dict]:
    """Inject all kinds of fault at random times of one trial, each in its own child process."""
    names = possible(names, law, page)
    settings = settings_of(condition, cube, law, clock="virtual", duration=9.0)
    clock = CampaignClock(settings.loop_rate)
    rig = FaultyRig(make_rig(settings, clock.now))
    rig.open()
    clock.page = InProcess(True, False, clock.now) if page else None
    make_stream = partial(private_stream, now=clock.now)
    case = Case(settings, rig, clock, make_stream, clock.page)
    case.arm()
    random_ = random.Random(f"{condition} {cube} {seed}")
    moments = sorted(random_.sample(range(100, 5900), instants))
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for n in range(moments[-1] + 1):
            case.loop.step()
            while moments and moments[0] == n:
                moments.pop(0)
                results += [forked(case, name, Path(folder), random_.random()) for name in names]
    return results


def forked(case: Case, name: str, folder: Path, seed: float) -> dict[str, Any]:
    """Run one case in a child process and return its result."""
    readable, writable = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            case.random.seed(seed)
            result = json.dumps(run_case(case, name, folder))
        except BaseException as error:
            result = json.dumps({"kind": name, "problems": [f"campaign: {error!r}"], "stop": 0.0})
        os.write(writable, result.encode())
        os._exit(0)
    os.close(writable)
    with os.fdopen(readable, "rb") as pipe:
        data = pipe.read()
    os.waitpid(child, 0)
    return json.loads(data)


def workers(jobs: list[tuple[Any, ...]]) -> list[dict[str, Any]]:
    """Run `virtual` for each job, with one process per processor."""
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(os.cpu_count()) as pool:
        futures = [pool.submit(virtual, *job) for job in jobs]
        return [result for future in futures for result in future.result()]


def real(
    condition: str,
    cube: str,
    name: str,
    seed: int,
    law: FeedbackName = "none",
    page: bool = False,
) -> dict[str, Any]:
    """Run one case in real time, from the start of a trial."""
    settings = settings_of(condition, cube, law, duration=6.0)

    class Clock(type(make_clock(settings))):  # type: ignore[misc]
        """The machine's clock, which can stall."""

        losing = once = 0

        def wait(self) -> Tick:
            stall, self.once = self.losing + self.once, 0
            time.sleep(stall * PERIOD)
            return super().wait()

    clock = Clock(settings.loop_rate)
    rig = FaultyRig(make_rig(settings, clock.now))
    rig.open()
    make_stream = partial(Stream, shared=page)
    case = Case(settings, rig, clock, make_stream, PageProcess(True) if page else None)
    try:
        with realtime("try") as real_time, tempfile.TemporaryDirectory() as folder:
            real_time.start()
            case.arm()
            case.random.seed(seed)
            for _ in range(case.random.randrange(300, 1200)):
                case.loop.step()
            return run_case(case, name, Path(folder), LATE + PAGE_LATE * KINDS[name].paged)
    finally:
        case.stream.unlink()
        if case.page:
            case.page.end()


def patient(*case: Any) -> dict[str, Any]:
    """Run `real`, and repeat it twice if the machine was too busy for the loop."""
    for _ in range(3):
        row = real(*case)
        if not row["problems"] or row["fault"] not in BUSY:
            break
    return row


def table(results: list[dict[str, Any]]) -> int:
    """Print a line for each kind; return the number of cases with a problem."""
    print(
        f"{'kind':<30}{'cases':>7}{'page':>7}{'due':>7}{'stop [ms]':>11}{'bound':>8}"
        f"{'overshoot':>11}  bad"
    )
    bad = 0
    for name, kind in KINDS.items():
        rows = [r for r in results if r["kind"] == name]
        if not rows:
            continue
        failed = [r for r in rows if r["problems"]]
        bad += len(failed)
        bound = "-" if math.isinf(kind.bound) else f"{kind.bound * 1e3:.0f}"
        print(
            f"{name:<30}{len(rows):>7}{sum(r.get('page', False) for r in rows):>7}"
            f"{sum(r.get('due', False) for r in rows):>7}"
            f"{max(r['stop'] for r in rows) * 1e3:>11.1f}{bound:>8}"
            f"{max(r.get('overshoot', 0.0) for r in rows):>10.1%}  {len(failed)}"
        )
        for row in failed[:3]:
            print(f"    {row.get('condition')}, {row.get('cube')}, {row.get('law')}, "
                  f"page {row.get('page')}, {row.get('instant', 0):.3f} s: "
                  f"{'; '.join(row['problems'])}")  # fmt: skip
    return bad


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--instants", type=int, default=200, help="for each kind and condition")
    parser.add_argument("--kind", action="append", choices=sorted(KINDS), help="only these kinds")
    parser.add_argument("--real", type=int, default=0, help="also runs of each in real time")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--law", action="append", choices=list(TRIALS), help="only these laws")
    parser.add_argument("--page", choices=("with", "without"), help="only with, or without, a page")
    options = parser.parse_args()
    names = options.kind or list(KINDS)
    laws = options.law or list(TRIALS)
    pages = [page for page in (False, True) if options.page in (None, ("without", "with")[page])]
    jobs = [
        (condition, cube, names, math.ceil(options.instants / len(cubes)), options.seed, law, page)
        for law, (conditions, cubes, _) in TRIALS.items()
        if law in laws
        for condition in conditions
        for cube in cubes
        for page in pages
    ]
    print(f"# python {shlex.join(sys.argv)}, {date.today()}")
    started = time.perf_counter()
    bad = 0
    if options.instants:
        results = workers(jobs)
        print(f"virtual time, {len(results)} cases in {time.perf_counter() - started:.0f} s")
        bad += table(results)
    if options.real:
        late_jumps()
        timed = [
            patient(condition, cubes[(i + run) % len(cubes)], name, run, law, page)
            for run in range(options.real)
            for law, (conditions, cubes, _) in TRIALS.items()
            if law in laws
            for page in pages
            for i, name in enumerate(possible(names, law, page))
            for condition in conditions
        ]
        print(f"real time, {len(timed)} cases")
        bad += table(timed)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
