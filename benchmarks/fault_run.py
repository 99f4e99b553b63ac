"""Run one case of the campaign: inject a fault, and check the reaction against its kind."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

from fault_case import Case
from fault_evidence import at_once
from fault_kinds import CONTINUES, KINDS, PERIOD

from teleop.recording.mcap_reader import read_intact
from teleop.safety import Mode
from teleop.streams.message import messages_of
from teleop.trial.readers import ESTIMATION

SETTLE = 60
"""Number of ticks that are run after standstill, because the contact force may still increase."""
LONGEST = 1500
"""Number of ticks after which a case ends, even if the fault could not be detected. The time limit
of the kind is added."""
OVERSHOOT = 0.05
"""Allowed overshoot over the hard force limit, as a fraction of the limit."""


def run_case(case: Case, name: str, folder: Path, slack: float = 0.0) -> dict[str, Any]:
    """Inject a fault now, run until standstill, and return the result.

    `slack` is the allowed lateness of a tick in real time [s].
    """
    kind = KINDS[name]
    readers, stream = case.readers, case.stream
    readers.begin_recording(folder / f"{os.getpid()}.mcap")
    taken = stream.newest
    kind.inject(case)
    started = case.clock.now()
    known, stopped, travel, change, peak = math.inf, 0.0, 0.0, 0.0, 0.0
    speed = case.speed
    quiet = 0
    alive = True
    longest = LONGEST + (0 if math.isinf(kind.bound) else round(kind.bound / PERIOD))
    for n in range(longest):
        if case.killed:
            case.clock.wait()
            case.sim.read()
        elif alive:
            before = case.clock.now()
            alive = case.loop.step()
            passed = case.clock.now() - before
            travel += abs(case.speed) * passed
            case.master_travel += abs(case.sim._applied.master_velocity) * passed
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
        if n > 400 and kind.faults == CONTINUES and not (case.killed or kind.ends):
            break
    readers.close()
    events = [e for e in stream.events if e["fault"]]
    fault = next((e["fault"] for e in events if e["fault"] in kind.faults), None)
    if events and not fault:
        fault = events[0]["fault"]
    sources = {e["source"] for e in events if e["fault"] == fault}
    took = max(stopped - known, 0.0) if done and known < math.inf else 0.0
    problems = []
    due = known < math.inf
    if fault not in kind.faults and (due or fault is not None):
        problems.append(f"called {fault}")
    if due and kind.source and events and kind.source not in sources:
        problems.append(f"source {', '.join(sources)}")
    if not took <= kind.bound + slack + 1e-9:
        problems.append(f"stopped after {took * 1e3:.1f} ms")
    if kind.ends and (alive or fault):
        problems.append("did not end in good order")
    overshoot = peak - case.limits.hard_force if kind.obeys else -case.limits.hard_force
    if overshoot > OVERSHOOT * case.limits.hard_force:
        problems.append(f"contact force {overshoot:.1f} N over the limit")
    if kind.notes and not any(e["source"] == ESTIMATION for e in stream.events):
        problems.append("no note about the estimation")
    try:
        broken = name in ("disk full", "recorder killed")
        data = bytes(read_intact(readers.path).messages)
        pushed = messages_of(stream.reader().rows(readers.first, stream.newest + 1)[2])
        whole = len(pushed) if not broken else taken - readers.first + 1
        kept = len(data) // len(pushed[0])
        if kept < whole or data != b"".join(pushed[:kept]):
            problems.append(f"recording holds {kept} of {whole} ticks")
    except Exception as error:
        problems.append(f"recording: {error}")
    readers.path.unlink(missing_ok=True)
    return {
        "kind": name,
        "condition": case.settings.condition,
        "cube": case.settings.cube,
        "law": case.settings.feedback.law,
        "page": case.page is not None,
        "instant": started,
        "fault": str(fault) if fault else None,
        "due": due,
        "stop": took,
        "overshoot": overshoot / case.limits.hard_force,
        "overshoot_n": overshoot,
        "problems": problems,
    }
