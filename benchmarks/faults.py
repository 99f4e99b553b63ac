"""The fault campaign: every kind of fault at random instants under every condition.

    python benchmarks/faults.py                     # 500 instants a kind and condition
    python benchmarks/faults.py --instants 50
    python benchmarks/faults.py --real 2            # and in real time, twice each

In virtual time a trial runs once for each condition and cube; at each instant it forks, and in
the child the fault sets in. What the drives are told and the true contact force come from the
simulated plant, not from what the controller reads. Prints, for each kind, the longest time to
standstill beside its bound and the greatest overshoot of the hard force limit; exits with 1 if
any case is not as docs/safety.md states.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers import CHANNELS
from sim_backend import Cube
from sim_backend.faults import (
    FaultyRig,
    Frozen,
    Replaced,
    Reported,
    RigFault,
    Runaway,
    Shifted,
    Unplugged,
)
from sim_backend.plant import Intention
from teleop.black_box import BlackBox
from teleop.clock import Tick, VirtualClock
from teleop.recorder.mcap_file import McapFile
from teleop.recorder.mcap_reader import read_intact
from teleop.recorder.schema import Layout
from teleop.recorder.sinks import Outcome, Sink, event_record
from teleop.recording import load
from teleop.safety import Fault, Mode
from teleop.safety.palpation import FROZEN, FROZEN_SPEED, STOPPING
from teleop.session import Session
from teleop.settings import TrialSettings
from teleop.stop_switch import StopSwitch

PERIOD = 1e-3
RAMP = STOPPING + PERIOD
WATCHDOG = 0.1
SETTLE = 60
"""Ticks that are run after standstill, for the contact force to reach its peak."""
LONGEST = 1500
"""Ticks after which a fault that could not show itself is let go."""
LATE = 0.02
"""How late a tick may be in real time without a real-time set-up [s]."""
OVERSHOOT = 0.05
"""Overshoot of the hard force limit that is stated, as a share of it."""


class CampaignClock(VirtualClock):
    """Virtual time that can be lost."""

    def __init__(self, rate: float) -> None:
        super().__init__(rate)
        self.losing = 0
        self.once = 0

    def wait(self) -> Tick:
        lost, self.once = self.losing + self.once, 0
        self._tick += lost
        super().wait()
        return Tick(0.0, lost > 0, lost)


class FileSink(Sink):
    """The recorder's file without its process: flushed as often, killed without being closed."""

    def __init__(self, path: Path, layout: Layout, columns: Any) -> None:
        self.path = path
        self._file = McapFile(path, columns, layout.definition, {})
        self._file.begin(0)
        self.pushed: list[bytes] = []
        self.alive = True

    def push(self, message: bytes) -> None:
        self.pushed.append(message)
        if self.alive:
            self._file.tick(message, 1e-3 * len(self.pushed))
            if len(self.pushed) % 80 == 0:
                self._file.flush()

    def event(self, event: Any) -> None:
        if self.alive:
            self._file.event(event_record(event))

    def kill(self) -> None:
        """As SIGKILL: nothing more reaches the file, not even what was taken in."""
        self.alive = False
        rest = self.path.with_suffix(".killed.mcap")
        rest.write_bytes(self.path.read_bytes())
        self.path.unlink()
        self.path = rest

    def fill(self) -> None:
        """As a disk that is full."""

        def refuse(data: bytes) -> int:
            self._file._disk.error = OSError(28, "No space left on device")
            raise self._file._disk.error

        self._file._disk.write = refuse

    def close(self) -> Outcome:
        self._file.close()
        return Outcome(self.path, len(self.pushed), 0, "")


class Case:
    """One trial with a fault to come."""

    def __init__(self, settings: TrialSettings, rig: FaultyRig, clock: Any) -> None:
        self.settings, self.rig, self.clock = settings, rig, clock
        self.sim = rig.rig
        self.limits = settings.limits
        self.bank = settings.make_bank()
        self.layout = Layout(self.bank)
        self.box = BlackBox(self.layout, settings.rate)
        self.switch = StopSwitch()
        self.sinks: list[Sink] = []
        self.random = random.Random(0)
        self.killed = False
        self.session = Session(
            settings, clock, rig, self.bank, self.layout, self.sinks, self.box, self.switch
        )

    @property
    def controller(self) -> Any:
        return self.session.controller

    @property
    def speed(self) -> float:
        """What the slave's drive is told, truly [m/s]."""
        return self.sim._applied.slave_velocity

    @property
    def force(self) -> float:
        """The true contact force [N]."""
        return self.sim.plant.slave.force

    @property
    def measured(self) -> Any:
        return self.controller._measurement


Inject = Callable[[Case], Any]
Evidence = Callable[[Case, float, float], bool]
"""Of the case, the travel commanded so far [m] and the change of velocity commanded [m/s]."""


def at_once(case: Case, travel: float, change: float) -> bool:
    return True


@dataclass
class Kind:
    """A kind of fault."""

    inject: Inject
    faults: frozenset[Fault | None]
    """What it may be called; None where the run must go on."""
    bound: float
    """Time from the fault's evidence to a commanded speed of zero [s]."""
    source: str = ""
    """Where it must be said to come from."""
    evidence: Evidence = at_once
    """Whether it can be known yet."""
    ends: bool = False
    """Whether the run must come to an orderly end."""


def rig_fault(make: Callable[[Case], RigFault]) -> Inject:
    return lambda case: case.rig.inject(make(case))


def moved(case: Case, travel: float, change: float) -> bool:
    """A frozen encoder shows once its drive has travelled."""
    return travel > FROZEN * case.settings.setup.depth


def accelerated(case: Case, travel: float, change: float) -> bool:
    """A frozen velocity shows once another one has been commanded."""
    return change > FROZEN_SPEED * case.limits.max_velocity


def raiser(*arguments: Any) -> Any:
    raise ZeroDivisionError("injected")


def break_estimator(case: Case) -> None:
    case.bank["rls"].advance = raiser  # type: ignore[method-assign]


def break_condition(case: Case) -> None:
    case.controller._condition.drive_force = raiser


def runaway(case: Case) -> RigFault:
    most = case.limits.max_velocity
    return Runaway(case.random.choice((-1.0, 1.0)) * case.random.uniform(0.3, 1.0) * most)


class Shove:
    """An operator who pushes on to three times the depth, at half of the greatest speed."""

    def __init__(self, case: Case) -> None:
        self.before, self.start = case.sim._operator, case.clock.now() - case.sim._start
        self.depth, self.speed = 3.0 * case.settings.setup.depth, 0.5 * case.limits.max_velocity

    def intention(self, t: float) -> Intention:
        base = self.before.intention(t)
        push = min(self.speed * (t - self.start), self.depth)
        return Intention(base.position + push, base.velocity)


def shove(case: Case) -> None:
    if case.sim._operator:
        case.sim._operator = Shove(case)
        return
    injected = case.controller._condition.drive_force
    case.controller._condition.drive_force = lambda t, m: 4.0 * injected(t, m)


class Inclusion(Cube):
    """A cube with something ten times as stiff inside, from the present depth on."""

    def force(self, x: float, v: float) -> float:
        hard = max(x - self.surface, 0.0) * self.stiffness  # type: ignore[attr-defined]
        return super().force(x, v) + hard


def include(case: Case) -> None:
    slave = case.sim.plant.slave
    cube = Inclusion(slave.cube.k1, slave.cube.k3, slave.cube.b)
    object.__setattr__(cube, "surface", max(slave.x, 0.3 * case.settings.setup.depth))
    object.__setattr__(cube, "stiffness", 10.0 * cube.k1)
    slave.cube = cube


def back(case: Case, travel: float, change: float) -> bool:
    """A loop that stalled finds out once it is back; until then the drives' watchdog acts."""
    return True


def over_force(case: Case, travel: float, change: float) -> bool:
    return abs(case.measured.contact_force) > case.limits.hard_force


def interrupt(times: int) -> Inject:
    def ask(case: Case) -> None:
        case.switch._asked, case.switch._reason = times, "Ctrl-C"

    return ask


def press(case: Case) -> None:
    case.switch._pressed = True


def lose(once: int, always: int) -> Inject:
    def stall(case: Case) -> None:
        case.clock.once, case.clock.losing = once, always

    return stall


def sensor_kinds() -> dict[str, Kind]:
    kinds = {}
    for channel in CHANNELS:
        quantity = channel.rpartition("_")[2]
        step = {"force": 120.0, "position": 0.1, "velocity": 1.5}[quantity]
        beyond = {"force": 3000.0, "position": 3.0, "velocity": 9.0}[quantity]

        def kind(
            make: Callable[[], RigFault], fault: Fault, bound: float, c: str = channel, **more: Any
        ) -> Kind:
            return Kind(rig_fault(lambda case: make()), frozenset({fault}), bound, c, **more)

        force = quantity == "force"
        kinds |= {
            f"{channel} NaN": kind(
                lambda c=channel: Replaced(c, math.nan), Fault.NOT_A_NUMBER, RAMP
            ),
            f"{channel} infinite": kind(
                lambda c=channel: Replaced(c, -math.inf), Fault.INFINITE, RAMP
            ),
            f"{channel} out of range": kind(
                lambda c=channel, b=beyond: Replaced(c, b), Fault.OUT_OF_RANGE, RAMP
            ),
            f"{channel} jump": kind(lambda c=channel, s=step: Shifted(c, s), Fault.JUMP, RAMP),
            f"{channel} stale": kind(
                lambda c=channel: Frozen(c, ageing=True), Fault.STALE, 0.02 + RAMP + PERIOD
            ),
            f"{channel} frozen": kind(
                lambda c=channel: Frozen(c, ageing=False),
                Fault.FROZEN,
                (0.05 if force else 0.0) + RAMP + 2 * PERIOD,
                evidence={"force": at_once, "position": moved, "velocity": accelerated}[quantity],
            ),
        }
    return kinds


def late_jumps() -> None:
    """A jump seen late in real time may be possible, and then passes a limit instead."""
    for channel, fault in (
        ("contact_force", Fault.FORCE_LIMIT),
        ("slave_position", Fault.POSITION_LIMIT),
        ("slave_velocity", Fault.VELOCITY_LIMIT),
    ):
        KINDS[f"{channel} jump"].faults |= {fault}


def recorder(failure: str) -> Inject:
    def fail(case: Case) -> None:
        sink = next(sink for sink in case.sinks if isinstance(sink, FileSink))
        getattr(sink, failure)()

    return fail


def die(case: Case) -> None:
    case.killed = True


GOES_ON: frozenset[Fault | None] = frozenset({None})
KINDS = sensor_kinds() | {
    "drive error": Kind(
        rig_fault(lambda case: Reported("overcurrent")), frozenset({Fault.DRIVE_ERROR}), PERIOD
    ),
    "emergency-stop input": Kind(
        rig_fault(lambda case: Reported(emergency_stop=True)),
        frozenset({Fault.EMERGENCY_STOP}),
        PERIOD,
    ),
    "emergency-stop key": Kind(press, frozenset({Fault.EMERGENCY_STOP}), PERIOD),
    "contact force over limit": Kind(
        rig_fault(lambda case: Shifted("contact_force", 0.0, 3000.0)),
        # a force to which the drive does not give way may be told by that first
        frozenset({Fault.FORCE_LIMIT, Fault.NOT_FOLLOWING}),
        PERIOD,
        evidence=over_force,
    ),
    "inclusion in the tissue": Kind(
        include, frozenset({None, Fault.FORCE_LIMIT}), PERIOD, evidence=over_force
    ),
    "operator pushes past limits": Kind(shove, GOES_ON, math.inf),
    "runaway plant": Kind(
        rig_fault(runaway),
        frozenset({Fault.NOT_FOLLOWING, Fault.VELOCITY_LIMIT, Fault.FROZEN}),
        0.1,
    ),
    "rig unplugged": Kind(
        rig_fault(lambda case: Unplugged()), frozenset({Fault.RIG_FAILURE}), PERIOD
    ),
    "loop stalls 200 ms": Kind(lose(200, 0), frozenset({Fault.OVERRUN}), PERIOD, evidence=back),
    "loop skips 3 of 4 periods": Kind(lose(0, 3), frozenset({Fault.OVERRUN}), 0.5),
    "exception in an estimator": Kind(
        break_estimator, frozenset({Fault.ESTIMATION_FAILURE}), RAMP + PERIOD
    ),
    "exception in the condition": Kind(break_condition, frozenset({Fault.CONTROL_FAILURE}), RAMP),
    "disk full": Kind(recorder("fill"), GOES_ON, math.inf),
    "recorder killed": Kind(recorder("kill"), GOES_ON, math.inf),
    "controller killed": Kind(die, GOES_ON, WATCHDOG + PERIOD),
    "Ctrl-C": Kind(interrupt(1), GOES_ON, RAMP, ends=True),
    "Ctrl-C twice": Kind(interrupt(2), GOES_ON, PERIOD, ends=True),
}


def run_case(case: Case, name: str, folder: Path, slack: float = 0.0) -> dict[str, Any]:
    """Let a fault set in now, and see what becomes of it.

    The slack [s] is what a tick may be late by on a machine in real time.
    """
    kind = KINDS[name]
    sink = FileSink(folder / f"{os.getpid()}.mcap", case.layout, case.layout.columns)
    for message in list(case.box._messages)[-200:]:
        sink.push(message)
    case.sinks.append(sink)
    taken = len(sink.pushed)
    kind.inject(case)
    started = case.clock.now()
    known, stopped, travel, change, peak = math.inf, 0.0, 0.0, 0.0, 0.0
    speed = case.speed
    quiet = 0
    alive = True
    for n in range(LONGEST):
        if case.killed:
            case.clock.wait()
            case.sim.read()
        elif alive:
            before = case.clock.now()
            alive = case.session.step()
            travel += abs(case.speed) * (case.clock.now() - before)
            change += abs(case.speed - speed)
            speed = case.speed
        else:
            case.clock.wait()
            case.sim.read()
        now = case.clock.now()
        if known == math.inf and kind.evidence(case, travel, change):
            known = started if kind.evidence is at_once else now
        peak = max(peak, abs(case.force))
        if case.speed != 0.0:
            stopped, quiet = math.inf, 0
        else:
            stopped = now if quiet == 0 else stopped
            quiet += 1
        tripped = case.controller.mode is Mode.FAULT
        done = tripped or not alive or case.killed
        if done and quiet > SETTLE:
            break
        if n > 400 and kind.faults == GOES_ON and not (case.killed or kind.ends):
            break
    for other in case.sinks:
        other.close()
    event = next((e for e in case.box._events if e.fault), None)
    fault = event.fault if event else None
    took = max(stopped - known, 0.0) if done and known < math.inf else 0.0
    problems = []
    due = known < math.inf
    if fault not in kind.faults and (due or fault is not None):
        problems.append(f"called {fault}")
    if due and kind.source and event and event.source != kind.source:
        problems.append(f"source {event.source}")
    if not took <= kind.bound + slack + 1e-9:
        problems.append(f"stopped after {took * 1e3:.1f} ms")
    if kind.ends and (alive or fault):
        problems.append("did not end in good order")
    overshoot = peak - case.limits.hard_force
    if overshoot > OVERSHOOT * case.limits.hard_force:
        problems.append(f"contact force {overshoot:.1f} N over the limit")
    try:
        broken = name in ("disk full", "recorder killed")
        data = read_intact(sink.path).messages if broken else None
        kept = len(data) // case.layout.size if broken else len(load(sink.path))
        whole = len(sink.pushed) if not broken else taken // 80 * 80
        if kept < whole or (broken and bytes(data) != b"".join(sink.pushed[:kept])):
            problems.append(f"recording holds {kept} of {whole} ticks")
    except Exception as error:
        problems.append(f"recording: {error}")
    sink.path.unlink(missing_ok=True)
    return {
        "kind": name,
        "condition": case.settings.condition,
        "cube": case.settings.cube,
        "instant": started,
        "fault": str(fault) if fault else None,
        "due": due,
        "stop": took,
        "overshoot": overshoot / case.limits.hard_force,
        "overshoot_n": overshoot,
        "problems": problems,
    }


def virtual(condition: str, cube: str, names: list[str], instants: int, seed: int) -> list[dict]:
    """All kinds at some instants of one trial, each in a child of its own."""
    settings = TrialSettings(condition=condition, cube=cube, clock="virtual", duration=7.0)
    clock = CampaignClock(settings.rate)
    rig = FaultyRig(settings.make_rig(clock.now))
    rig.open()
    case = Case(settings, rig, clock)
    random_ = random.Random(f"{condition} {cube} {seed}")
    moments = sorted(random_.sample(range(100, 5900), instants))
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for n in range(5900):
            case.session.step()
            while moments and moments[0] == n:
                moments.pop(0)
                results += [forked(case, name, Path(folder), random_.random()) for name in names]
    return results


def forked(case: Case, name: str, folder: Path, seed: float) -> dict[str, Any]:
    """One case in a child process."""
    readable, writable = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            case.random.seed(seed)
            answer = json.dumps(run_case(case, name, folder))
        except BaseException as error:
            answer = json.dumps({"kind": name, "problems": [f"campaign: {error!r}"], "stop": 0.0})
        os.write(writable, answer.encode())
        os._exit(0)
    os.close(writable)
    with os.fdopen(readable, "rb") as pipe:
        answer = pipe.read()
    os.waitpid(child, 0)
    return json.loads(answer)


def workers(jobs: list[tuple[Any, ...]]) -> list[dict[str, Any]]:
    """Run jobs of `virtual`, as many at a time as there are processors."""
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(os.cpu_count()) as pool:
        futures = [pool.submit(virtual, *job) for job in jobs]
        return [result for future in futures for result in future.result()]


def real(condition: str, cube: str, name: str, seed: int) -> dict[str, Any]:
    """One case in real time, from the start of a trial."""
    settings = TrialSettings(condition=condition, cube=cube, duration=3.0)

    class Clock(type(settings.make_clock())):  # type: ignore[misc]
        """The machine's clock, which can stall."""

        losing = once = 0

        def wait(self) -> Tick:
            stall, self.once = self.losing + self.once, 0
            time.sleep(stall * PERIOD)
            return super().wait()

    clock = Clock(settings.rate)
    rig = FaultyRig(settings.make_rig(clock.now))
    rig.open()
    case = Case(settings, rig, clock)
    case.random.seed(seed)
    for _ in range(case.random.randrange(300, 1200)):
        case.session.step()
    with tempfile.TemporaryDirectory() as folder:
        return run_case(case, name, Path(folder), LATE)


def table(results: list[dict[str, Any]]) -> int:
    """Print what became of each kind; the number of bad cases."""
    print(f"{'kind':<30}{'cases':>7}{'due':>7}{'stop [ms]':>11}{'bound':>8}{'overshoot':>11}  bad")
    bad = 0
    for name, kind in KINDS.items():
        rows = [r for r in results if r["kind"] == name]
        if not rows:
            continue
        wrong = [r for r in rows if r["problems"]]
        bad += len(wrong)
        bound = "-" if math.isinf(kind.bound) else f"{kind.bound * 1e3:.0f}"
        print(
            f"{name:<30}{len(rows):>7}{sum(r.get('due', False) for r in rows):>7}"
            f"{max(r['stop'] for r in rows) * 1e3:>11.1f}{bound:>8}"
            f"{max(r.get('overshoot', 0.0) for r in rows):>10.1%}  {len(wrong)}"
        )
        for row in wrong[:3]:
            print(f"    {row.get('condition')}, {row.get('cube')}, {row.get('instant', 0):.3f} s: "
                  f"{'; '.join(row['problems'])}")  # fmt: skip
    return bad


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--instants", type=int, default=500, help="for each kind and condition")
    parser.add_argument("--kind", action="append", choices=sorted(KINDS), help="these alone")
    parser.add_argument("--real", type=int, default=0, help="runs of each in real time as well")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    names = options.kind or list(KINDS)
    conditions, cubes = ("free", "mimic", "autonomous"), ("soft", "medium", "hard")
    each = math.ceil(options.instants / len(cubes))
    jobs = [(c, q, names, each, options.seed) for c in conditions for q in cubes]
    started = time.perf_counter()
    results = workers(jobs) if options.instants else []
    print(f"virtual time, {len(results)} cases in {time.perf_counter() - started:.0f} s")
    bad = table(results)
    if options.real:
        late_jumps()
        timed = [
            real(condition, cubes[(i + run) % 3], name, run)
            for run in range(options.real)
            for i, name in enumerate(names)
            for condition in conditions
        ]
        print(f"\nreal time, {len(timed)} cases")
        bad += table(timed)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
