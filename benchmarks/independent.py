"""Check `teleop estimate` on records of other physics: `python benchmarks/independent.py`.

The records are simulated by `independent_bodies.py`, which shares no code with the package. The
cases are drawn at random from the kinds in `KINDS`. The physics without noise gives the truth for
the force and the frequency that the result states. For k this can be more than one number, each
of which is right:

- the slope of the force against the position in loading, near the stated force (for a steady sine
  without the equivalent viscous force, so that it is the storage stiffness of a linear body);
- the slope of the elastic force, for bodies that have one, at the depth of this point of the
  record, and at the depth at which the elastic force is the stated force.

b is k''/omega at the stated frequency, or else the derivative of the force to the velocity at these
two depths, for bodies that have one. Both refer to the tip and the compliance in series, without
lost motion and lag. k and b are judged separately:

- right: the 95 % interval contains the truth, or the error is below 1 % (b: below 0.02 k/omega);
- near: outside the interval, but the error is below 10 %;
- named: wrong or withheld, and a reason or remark names the cause that was put into the record;
- WRONG: none of these, or a number where none exists;
- refused: withheld without need, and the cause is not named;
- unnamed: rightly withheld, but with another cause as the reason.

A false alarm is a remark on a record without a fault that states no true fact of the case. A remark
on another cause counts neither as `named` nor as allowed. Records with a fault are counted if all
their remarks name other causes, also if k and b are right. Lost motion is invented if the result
contains it, for a body without fault on a transmission without lost motion. Seed 1 is for
development. An acceptance run uses a seed that was never used before.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import io
import json
import math
import re
import tempfile
import zlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import independent_bodies as physics
import numpy as np
from independent_bodies import Array, Linear, Physics, Springpot, Viscous, WithFriction
from independent_kinds import (
    ALWAYS_ALLOWED,
    KINDS,
    LINEAR_BODIES,
    ONE_SPEED,
    Draw,
    Kind,
    Log,
    Made,
)

from teleop.cli import main as teleop

SIMULATED_RATE = 20_000.0
"""Lowest rate of the simulation [Hz]."""
TRUTH_RATE = 2_000.0
"""Rate at which the truth is computed [Hz]."""
CLOSE, NEAR = 0.01, 0.1
CLOSE_LOSS = 0.02
"""Error of b, relative to k/omega, that counts as right: an error of tan delta."""


@dataclass(frozen=True)
class Case:
    """A record, and what is true of it."""

    kind: Kind
    seed: int
    draw: Draw
    log: Log
    truth: Physics
    body: Made

    def write(self, folder: Path) -> Path:
        name = re.sub(r"[^a-z0-9]+", "-", self.kind.name.lower())
        path = folder / f"{name}-{self.seed}.csv"
        table = np.column_stack([self.log.t, self.log.x * 1e3, self.log.f])
        header = "time_s,position_mm,force_N"
        np.savetxt(path, table, ["%.6f", "%.7g", "%.7g"], ",", header=header, comments="")
        return path

    @property
    def viscous(self) -> Viscous | None:
        """The part of the body whose force depends only on depth and velocity."""
        body = self.body.body if isinstance(self.body, WithFriction) else self.body
        return body if isinstance(body, Viscous) else None

    @property
    def is_linear(self) -> bool:
        """Whether the storage stiffness is the only stiffness."""
        return isinstance(self.body, Linear) or self.kind.body in LINEAR_BODIES

    @functools.cached_property
    def complex_stiffness(self) -> complex:
        """Complex stiffness of body and compliance at the frequency of a sine, in the steady state.

        The record of a body that relaxes still contains the decay of its start, which would change
        the fundamentals.
        """
        truth = self.truth
        if self.kind.body in LINEAR_BODIES:
            own = complex(self.body.complex_stiffness(self.draw.omega))
            return own / (1.0 + self.draw.notes.get("compliance", 0.0) * own)
        return physics.complex_stiffness(truth.t, truth.tip, truth.body, self.draw.frequency)

    def stiffnesses(self, force: float, named_storage: bool = False) -> list[float]:
        """Return the true stiffnesses at a force of the record; empty if there is none."""
        truth, body = self.truth, self.body
        if not self.kind.has_k:
            return []
        if self.kind.steady and self.is_linear:
            return [self.complex_stiffness.real]
        if isinstance(body, Linear):
            return [body.k / (1.0 + self.draw.notes.get("compliance", 0.0) * body.k)]
        if not truth.body.min() <= force <= truth.body.max():
            return []
        found: list[float | None] = [physics.loading_slope(truth.tip, truth.body, force)]
        if self.kind.steady and named_storage:
            found.append(self.complex_stiffness.real)
        if self.kind.steady:
            v = np.gradient(truth.tip, truth.t)
            beside_loss = truth.body - self.complex_stiffness.imag / self.draw.omega * v
            found.append(physics.loading_slope(truth.tip, beside_loss, force))
        if self.viscous:
            found += [float(k) for k in self.viscous.tangent(self.depths_at(force))]
        if isinstance(body, physics.Adhesive):
            found.append(body.k)
        return [k for k in found if k is not None]

    def depths_at(self, force: float) -> Array:
        """Return the depths at which the elastic force, and that in loading, have a value."""
        truth = self.truth
        d = np.sort(truth.depth)
        assert self.viscous is not None
        static = float(np.interp(force, self.viscous.elastic(d), d))
        near = np.abs(truth.body - force) < 0.02 * np.ptp(truth.body)
        near &= np.gradient(truth.depth) > 0.0
        return np.array([static, truth.depth[near].mean()] if near.any() else [static])

    def dampings(self, force: float, at_frequency: bool) -> list[float]:
        """Return the true values of b; empty if it is not defined."""
        if not self.kind.has_k:
            return []
        if self.kind.steady and (at_frequency or isinstance(self.body, Linear)):
            return [self.complex_stiffness.imag / self.draw.omega]
        if self.kind.link:
            return []
        if at_frequency:
            return [self.loss_per_velocity]
        if isinstance(self.body, physics.Adhesive):
            return [self.body.b]
        if self.viscous is None:
            return []
        return [float(b) for b in self.viscous.viscosity(self.depths_at(force))]

    @property
    def loss_per_velocity(self) -> float:
        """b that dissipates the same energy in contact."""
        truth = self.truth
        touching = truth.depth > 0.0
        d = truth.depth[touching] / np.ptp(truth.depth)
        v = np.gradient(truth.depth, truth.t)[touching]
        columns = np.column_stack([np.ones_like(d), d, d**2, d**3, v])
        return float(np.linalg.lstsq(columns, truth.body[touching], rcond=None)[0][-1])


def simulate(kind: Kind, seed: int, repeat: int) -> Case:
    """Return a case of a kind; the same numbers give the same case."""
    rng = np.random.default_rng([zlib.crc32(kind.name.encode()), seed, repeat])
    draw = Draw(rng, **kind.ranges)
    if kind.prepare:
        kind.prepare(draw)
    body = kind.body(draw)
    factor = math.ceil(SIMULATED_RATE / draw.rate)
    dt = 1.0 / (factor * draw.rate)
    before = math.ceil((10.0 if isinstance(body, Springpot) else 3.0) / dt) * dt
    t = np.arange(round((before + draw.seconds) / dt)) * dt - before
    x = kind.motion(draw, t)
    if kind.link:
        depth, tip, force = kind.link(draw, x, dt, body)
    else:
        depth = tip = x - kind.surface(draw, t, x) if kind.surface else x
        force = body.force(t, depth)
    sensor = force
    if kind.mass:
        mass = draw.uniform(0.1, 0.4) * draw.k / draw.omega**2
        draw.notes["mass"] = mass
        sensor = force + mass * np.gradient(np.gradient(x, t), t)
    # The sensors start one second before the record, after the start of the motion.
    use = slice(round((before - 1.0) / dt), None)
    at, measured_x, measured_f = t[use], x[use] + draw.origin, sensor[use]
    for change in kind.analog:
        measured_x, measured_f = change(draw, at, measured_x, measured_f)
    n = np.arange(1, round(draw.seconds * draw.rate) - 1)
    times = (n + kind.jitter * np.clip(rng.normal(size=len(n)), -1.9, 1.9)) / draw.rate
    log = sampled(draw, kind, at, measured_x, measured_f, times)
    for fault in kind.logged:
        log = fault(draw, log)
    n = np.arange(round(before / dt), len(t), max(1, round(1.0 / (TRUTH_RATE * dt))))
    truth = Physics(t[n], x[n], tip[n], force[n], sensor[n], depth[n])
    return Case(kind, repeat, draw, log, truth, body)


def sampled(draw: Draw, kind: Kind, t: Array, x: Array, f: Array, times: Array) -> Log:
    """Return position and force at the sampling times, with the noise of their sensors."""
    position = np.interp(times, t, x)
    force = np.interp(times, t, f)
    noise = draw.noise * (1.0 if kind.white else 0.1) * max(float(np.ptp(f)), 1e-3)
    position += draw.rng.normal(0.0, 0.5 * draw.resolution, len(times))
    force += draw.rng.normal(0.0, noise, len(times))
    return Log(times, physics.quantised(position, draw.resolution), force)


# Verdicts


def answer(path: Path, options: Iterable[str]) -> dict[str, Any]:
    """Return the result of `teleop estimate`, or the error message as the reason for no result."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = teleop(["estimate", str(path), *options, "--json"])
    if code == 2:
        return {"identifiable": False, "reasons": [err.getvalue().strip().splitlines()[-1]]}
    document: dict[str, Any] = json.loads(out.getvalue())
    result: dict[str, Any] = document["result"]
    result["reasons"] = result["reasons"] + document["reading"]
    return result


class Judged(NamedTuple):
    """The truth nearest to a number of the result, and the verdict."""

    truth: float | None
    verdict: str


def judge_k(case: Case, result: dict[str, Any], named: bool) -> Judged:
    k = result.get("k")
    if not result["identifiable"] or k is None:
        if named:
            return Judged(None, "named")
        return Judged(None, "refused" if case.kind.has_k else "unnamed")
    stated = str((result.get("kinds") or {}).get("k", ""))
    truths = case.stiffnesses(result["tangent"]["force_n"], "storage" in stated)
    if not truths:
        return Judged(None, "named" if named else "WRONG")
    truth = min(truths, key=lambda value: abs(value - k))
    if any(result["k_low"] <= value <= result["k_high"] for value in truths):
        return Judged(truth, "right")
    error = abs(k / truth - 1.0)
    if error < CLOSE:
        return Judged(truth, "right")
    return Judged(truth, "named" if named else "near" if error < NEAR else "WRONG")


def judge_b(case: Case, result: dict[str, Any], named: bool) -> Judged:
    b = result.get("b")
    if not result["identifiable"] or not case.kind.has_k:
        return Judged(None, "-")
    at_frequency = result.get("damping_at_hz") is not None
    truths = case.dampings(result["tangent"]["force_n"], at_frequency)
    if not truths:
        return Judged(None, "-")
    truth = min(truths, key=lambda value: abs(value - (b or 0.0)))
    constant_speed = any(re.search(ONE_SPEED, reason) for reason in result["reasons"])
    if b is None or constant_speed:
        return Judged(truth, "named" if named or constant_speed else "refused")
    slack = CLOSE_LOSS * abs(result["k"]) / case.draw.omega
    error = abs(b - truth)
    inside = any(result["b_low"] <= value <= result["b_high"] for value in truths)
    if inside or error < max(slack, CLOSE * abs(truth)):
        return Judged(truth, "right")
    return Judged(truth, "named" if named else "near" if error < NEAR * abs(truth) else "WRONG")


CLAIM = r" and (?=force relaxes|the stiffness|the damping|friction)"


def claims(reason: str) -> list[str]:
    """Return the parts of a remark that state different causes."""
    inside = re.fullmatch(r"(Kelvin-Voigt is insufficient: )(.*)(; residual.*)", reason, re.DOTALL)
    if inside is None:
        return [reason]
    return [inside[1] + part + inside[3] for part in re.split(CLAIM, inside[2])]


def evaluate(case: Case, path: Path) -> dict[str, Any]:
    """Return the verdicts on a case, as they are written by --json."""
    result = answer(path, case.draw.options)
    kind, reasons = case.kind, [str(reason) for reason in result["reasons"]]
    named = bool(kind.cause) and any(re.search(kind.cause, reason, re.I) for reason in reasons)
    allowed = "|".join(filter(None, [ALWAYS_ALLOWED, kind.allowed]))
    others = [c for r in reasons for c in claims(r) if not re.search(allowed, c, re.I)]
    alarms = others if result["identifiable"] and not kind.cause else []
    misled = bool(kind.cause) and not named and bool(others)
    k, b = judge_k(case, result, named), judge_b(case, result, named)
    return {
        "kind": kind.name,
        "repeat": case.seed,
        "k": k._asdict(),
        "b": b._asdict(),
        "false_alarms": alarms,
        "named": named,
        "misled": misled,
        "result": result,
        "options": case.draw.options,
        "drawn": {
            "k": case.draw.k,
            "b": case.draw.b,
            "frequency_hz": case.draw.frequency,
            "amplitude_m": case.draw.amplitude,
            "noise": case.draw.noise,
            "rate_hz": case.draw.rate,
            "seconds": case.draw.seconds,
            "tan_delta": case.draw.loss,
            **case.draw.notes,
        },
    }


def line(number: int, row: dict[str, Any]) -> str:
    result, texts = row["result"], []
    for symbol in "kb":
        shown = [
            f"{value:.4g}" if value is not None else "-"
            for value in (
                row[symbol]["truth"],
                *(result.get(symbol + end) for end in ("", "_low", "_high")),
            )
        ]
        estimate = f"{shown[1]} [{shown[2]}, {shown[3]}]"
        texts.append(f"{shown[0]:>9} {estimate:30} {row[symbol]['verdict']:8}")
    alarm = " FALSE ALARM" if row["false_alarms"] else ""
    reasons = row["false_alarms"] or result["reasons"]
    first = reasons[0].replace("\n", " ")[:90] if reasons else ""
    name = f"{row['kind']} {row['repeat']}"
    return f"{number:3} {name:26} k {texts[0]} b {texts[1]}{alarm} {first}".rstrip()


VERDICTS = ("right", "named", "near", "WRONG", "refused", "unnamed", "-")


def summary(rows: list[dict[str, Any]]) -> str:
    """Return the table of the kinds, and the totals."""
    head = " ".join(f"{verdict:>7}" for verdict in VERDICTS[:-1])
    lines = [f"{'kind':26} k {head}  b {head}  alarm"]
    for name in dict.fromkeys(row["kind"] for row in rows):
        of_kind = [row for row in rows if row["kind"] == name]
        cells = []
        for symbol in "kb":
            counts = Counter(row[symbol]["verdict"] for row in of_kind)
            cells.append(" ".join(f"{counts[v] or '.':>7}" for v in VERDICTS[:-1]))
        alarms = sum(bool(row["false_alarms"]) for row in of_kind)
        lines.append(f"{name:26} k {cells[0]}  b {cells[1]}  {alarms or '.':>5}")
    totals = {s: Counter(row[s]["verdict"] for row in rows) for s in "kb"}
    clean = sum(not kind.cause for kind in KINDS for row in rows if row["kind"] == kind.name)
    alarms = sum(bool(row["false_alarms"]) for row in rows)
    misled = sum(row["misled"] for row in rows)
    rigid = {kind.name for kind in KINDS if not kind.cause and not kind.link}
    found = [bool(row["result"].get("lost_motion_m")) for row in rows if row["kind"] in rigid]

    def total(verdict: str) -> str:
        return f"k {totals['k'][verdict]}, b {totals['b'][verdict]}"

    lines += [
        f"{len(rows)} cases of {len({row['kind'] for row in rows})} kinds",
        f"silent wrong answers: {total('WRONG')}",
        f"between the interval and 10 %: {total('near')}",
        f"needless refusals: {total('refused')}",
        f"withheld for another reason than the cause: {total('unnamed')}",
        f"false alarms: {alarms} of {clean} records without a fault",
        f"only other causes named: {misled} of {len(rows) - clean} records with a fault",
        f"lost motion invented: {sum(found)} of {len(found)} records without fault and lost motion",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=250)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", default="", help="regular expression of the names of the kinds")
    parser.add_argument("--only", type=int, help="number of the case to evaluate, from 1")
    parser.add_argument("--keep", type=Path, help="folder for the CSV files")
    parser.add_argument("--json", type=Path, help="file for all results")
    chosen = parser.parse_args()
    wanted = re.compile(chosen.kind)
    if chosen.keep:
        chosen.keep.mkdir(parents=True, exist_ok=True)
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        for number in range(1, chosen.cases + 1):
            kind, repeat = KINDS[(number - 1) % len(KINDS)], (number - 1) // len(KINDS)
            if chosen.only not in (None, number) or not wanted.search(kind.name):
                continue
            case = simulate(kind, chosen.seed, repeat)
            path = case.write(chosen.keep or Path(temporary))
            rows.append(evaluate(case, path) | {"number": number})
            print(line(number, rows[-1]), flush=True)
            if not chosen.keep:
                path.unlink()
    print("\n" + summary(rows))
    if chosen.json:
        chosen.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
