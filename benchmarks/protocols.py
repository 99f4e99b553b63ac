"""Coverage of the intervals of protocols, on relaxing bodies with random parameters.

Each seed draws a body with two Maxwell branches and performs the protocols stress-relaxation and
creep on the simulated rig. A body without a branch must have no time constant.

    python benchmarks/protocols.py --seeds 24 --first-seed 733900
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import replace

import numpy as np

from sim_backend import Cube, Relaxing, Setup
from teleop.settings.protocol_files import load_protocol
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial


def body_of(seed: int) -> tuple[Cube, tuple[tuple[float, float], ...]]:
    """Return a spring, and stiffness [N/m] and relaxation time [s] of two Maxwell branches."""
    draw = np.random.default_rng(seed)
    k = float(draw.uniform(800.0, 4000.0))
    fast, slow = float(draw.uniform(0.4, 0.9)), float(draw.uniform(3.0, 7.0))
    shares = draw.uniform(0.15, 0.5, 2)
    return Cube(k, 0.0, 2.0, True), ((k * float(shares[0]), fast), (k * float(shares[1]), slow))


def retardation_times(k: float, branches: tuple[tuple[float, float], ...]) -> list[float]:
    """Return the retardation times [s] of a generalised Maxwell body: the zeros of its modulus."""
    one = np.polynomial.Polynomial([1.0])
    poles = [np.polynomial.Polynomial([1.0, tau]) for _, tau in branches]
    total = k * poles[0] * poles[1]
    for i, (stiffness, tau) in enumerate(branches):
        total = total + np.polynomial.Polynomial([0.0, stiffness * tau]) * poles[1 - i] * one
    return sorted(float(-1.0 / root.real) for root in total.roots())


def steps(protocol: str, body: object, seed: int) -> list[dict]:
    """Return the results of the steps of a trial."""
    read = load_protocol(protocol)
    trial = run_trial(
        TrialSettings(
            protocol=read,
            duration=read.longest,
            clock="virtual",
            seed=seed,
            estimators=("rls",),
            custom_setup=Setup(body, 2.66e-3, 4e-3),
        )
    )
    if trial.fault:
        raise SystemExit(f"seed {seed}, {protocol}: {trial.fault['text']}")
    return trial.result.summary["steps"]


def main() -> None:
    """Print the coverage for each kind of hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first-seed", type=int, required=True)
    options = parser.parse_args()
    inside: dict[str, list[bool]] = defaultdict(list)
    widths: dict[str, list[float]] = defaultdict(list)
    withheld: dict[str, int] = defaultdict(int)
    invented = holds = 0
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        cube, branches = body_of(seed)
        inner: object = cube
        for k, tau in branches:
            inner = Relaxing(inner, k, tau)
        true = {
            "relaxation": sorted(tau for _, tau in branches),
            "creep": retardation_times(cube.k1, branches),
        }
        for kind, protocol in (("relaxation", "stress-relaxation"), ("creep", "creep")):
            for one in steps(protocol, inner, seed):
                found = one.get(kind)
                if not found:
                    continue
                if found["reason"] or len(found["parts"]) != len(true[kind]):
                    withheld[kind] += 1
                    continue
                for part, tau in zip(found["parts"], true[kind], strict=True):
                    inside[kind].append(part["low"] <= tau <= part["high"])
                    widths[kind].append((part["high"] - part["low"]) / (2.0 * tau))
        for one in steps("stress-relaxation", replace(cube), seed):
            if "relaxation" in one:
                holds += 1
                invented += bool(one["relaxation"]["parts"])
    print(f"{options.seeds} bodies, first seed {options.first_seed}\n")
    print("| hold | time constants | inside | median half width | holds without a statement |")
    print("| --- | --- | --- | --- | --- |")
    for kind, found in inside.items():
        print(
            f"| {kind} | {len(found)} | {np.mean(found):.1%} | {np.median(widths[kind]):.1%} "
            f"| {withheld[kind]} |"
        )
    print(f"\nelastic bodies: a relaxation is invented in {invented} of {holds} holds")


if __name__ == "__main__":
    main()
